"""Run the notebooks of the site, keep what they show, and write each as a page beside it.

    PYTHONPATH=benchmarks python docs/tools/notebooks.py

Needs the extra "docs" and measured data (`measured_data`).
"""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

from examples import NOTEBOOKS, ROOT, put_files

FOLDER = ROOT / "docs" / "notebooks"


def main() -> None:
    """Run and write all."""
    for name in NOTEBOOKS:
        path = FOLDER / f"{name}.ipynb"
        notebook = nbformat.read(path, as_version=4)
        with TemporaryDirectory() as folder:
            put_files(name, Path(folder))
            NotebookClient(notebook, timeout=600, resources={"metadata": {"path": folder}}).execute()
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)  # when, which is of no interest
        nbformat.write(notebook, path)
        write_page(path)


def write_page(path: Path) -> None:
    """The notebook as Markdown, with its pictures in files."""
    text, resources = MarkdownExporter().from_filename(str(path), resources={"output_files_dir": f"{path.stem}_files"})
    for name, picture in resources["outputs"].items():
        (path.parent / name).parent.mkdir(exist_ok=True)
        (path.parent / name).write_bytes(picture)
    download = f"\n[This page as a notebook]({path.name}), to run and to change.\n"
    heading, rest = text.split("\n", 1)
    path.with_suffix(".md").write_text(heading + "\n" + download + rest, encoding="utf-8")


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    main()
