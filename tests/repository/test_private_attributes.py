"""Dask and dask-jobqueue are used by what they promise, not by what they happen to have inside."""

import ast
from pathlib import Path

import kinertia

SOURCES = Path(kinertia.__file__).parent


def private_attributes(path: Path) -> list[str]:
    """Lines of a file that imports dask and reads an attribute with an underscore of anything but its own objects."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    if not any(name.split(".")[0] in ("dask", "distributed", "dask_jobqueue") for name in names):
        return []
    return [
        f"{path.name}:{node.lineno} {node.attr}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__")
        if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"))
    ]


def test_no_private_attribute_of_dask_is_touched():
    using = [path for path in SOURCES.rglob("*.py") if "dask" in path.read_text(encoding="utf-8")]
    assert using
    assert [line for path in using for line in private_attributes(path)] == []


def test_a_private_attribute_would_be_seen(tmp_path):
    path = tmp_path / "one.py"
    path.write_text("from dask.distributed import Client\nClient()._loop\n", encoding="utf-8")
    assert private_attributes(path) == ["one.py:2 _loop"]
