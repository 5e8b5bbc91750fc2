"""Run the notebooks of the site and keep what they show.

    PYTHONPATH=. python docs/tools/notebooks.py

Needs the extra "docs" and measured data (`measured_data`).
"""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

from examples import NOTEBOOKS, ROOT, put_files

FOLDER = ROOT / "docs" / "notebooks"


def main() -> None:
    """Run all."""
    for name in NOTEBOOKS:
        path = FOLDER / f"{name}.ipynb"
        notebook = nbformat.read(path, as_version=4)
        with TemporaryDirectory() as folder:
            put_files(name, Path(folder))
            NotebookClient(notebook, timeout=600, resources={"metadata": {"path": folder}}).execute()
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)  # when, which is of no interest
        nbformat.write(notebook, path)


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    main()
