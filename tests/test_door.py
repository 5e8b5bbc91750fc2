"""The public door: `import kinertia` and nothing else."""

import ast
import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kinertia
from command_line import loaded_after

HEAVY = ("plotly", "matplotlib", "jinja2", "pandas", "scipy.stats")
PACKAGE = Path(kinertia.__file__).parent
CLASSES = [name for name in kinertia.__all__ if inspect.isclass(getattr(kinertia, name))]


def test_the_import_loads_nothing_heavy():
    assert not loaded_after("import kinertia").intersection((*HEAVY, "numpy"))


def test_a_name_is_loaded_when_it_is_used_and_data_know_no_reports():
    loaded = loaded_after("import kinertia\nkinertia.Markers")
    assert "kinertia.trial.data" in loaded
    assert not loaded.intersection((*HEAVY, "kinertia.report", "kinertia.model"))


def test_type_checkers_see_the_names_that_are_loaded():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    seen = {
        alias.asname: f"{node.module}"
        for block in tree.body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == {name: f"kinertia.{home}" for name, home in kinertia._HOMES.items()}
    assert set(kinertia.__all__) < set(dir(kinertia))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'fit_everything'"):
        _ = kinertia.fit_everything


def test_the_house_has_few_rooms():
    """Fifteen since findings, the road to a result and cohorts have rooms of their own."""
    rooms = {path.stem for path in PACKAGE.iterdir() if path.suffix in ("", ".py")} - {
        "__init__",
        "__main__",
        "__pycache__",
    }
    assert len(rooms) <= 15


@pytest.fixture
def workshop(demo_run, tmp_path, monkeypatch):
    """A folder as `kinertia demo` leaves it, to work in."""
    for path in demo_run[1].glob("[!.]*"):
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.usefixtures("workshop")
def test_every_public_class_has_an_example_that_runs(name, fit):
    doctests = doctest.DocTestFinder(recurse=False).find(
        getattr(kinertia, name), name, globs={"kinertia": kinertia, "np": np, "fit": fit}
    )
    assert doctests[0].examples, f"{name} has no example in its docstring"
    said = []
    doctest.DocTestRunner().run(doctests[0], out=said.append)
    assert not said, "".join(said)


@pytest.mark.slow
def test_a_consumer_with_mypy_sees_types(tmp_path):
    program = (
        "import kinertia\n\ndef told(fit: kinertia.Fit) -> None:\n    reveal_type(fit.bsp)\n    kinertia.fit_all\n"
    )
    (tmp_path / "consumer.py").write_text(program)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "consumer.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert 'Revealed type is "pandas.core.frame.DataFrame"' in done.stdout
    assert 'Module has no attribute "fit_all"' in done.stdout
