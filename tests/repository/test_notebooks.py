"""The notebooks of the site run, and show what they show."""

import json
import sys
from types import SimpleNamespace

import pytest

from examples import NOTEBOOKS, ROOT, difference, put_files
from kinertia.io.samples import VARIABLE

FOLDER = ROOT / "docs" / "notebooks"


def cells(name):
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def printed(cell):
    return "".join("".join(out["text"]) for out in cell["outputs"] if out["output_type"] == "stream")


def test_every_notebook_is_known_and_has_been_run():
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NOTEBOOKS)
    for name in NOTEBOOKS:
        numbers = [cell["execution_count"] for cell in cells(name)]
        assert numbers == list(range(1, len(numbers) + 1))
        assert not [out for cell in cells(name) for out in cell["outputs"] if out["output_type"] == "error"]


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebooks_run(name, tmp_path, monkeypatch, capsys, measured_folder):
    monkeypatch.setenv(VARIABLE, str(measured_folder))
    put_files(name, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(SVG=lambda path: (tmp_path / path).read_text()))
    namespace = {}
    for cell in cells(name):
        exec(compile("".join(cell["source"]), name, "exec"), namespace)
        shown, real = printed(cell), capsys.readouterr().out
        assert difference(shown, real) is None, f"shown:\n{shown}\nreally:\n{real}"
