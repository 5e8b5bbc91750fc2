"""What docstrings name in backticks is there: modules, classes, functions, arguments, keys of files."""

import ast
import re
from pathlib import Path

import kinertia

SOURCES = Path(kinertia.__file__).parent
_NAME = re.compile(r"`([A-Za-z_][\w.]*)`")
_FOREIGN = {
    *("pin.Inertia.toDynamicParameters", "scipy.ndimage", "to_netcdf", "cellstr", "relayout", "Host", "_z"),
    *("ForceData", "walk_f_1.tsv", "walk_f_2.tsv", "walk_f.tsv", "draw_001", "draw_002", "hand_r", "hand_l"),
    *("ground_force_r_vx", "ground_force_1_vx", "ground_torque_...x", "ground_moment_...mx", "metatarsal_inner_r"),
}
"""Of other programs, of files, and of what a pattern makes."""
_WORD = re.compile(r"[A-Za-z_]\w*")


def _docstrings(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, node.value.value


def _words(tree):
    """Every identifier of a file, and every word of its strings that are no docstrings."""
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        for field in ("id", "attr", "arg", "name"):
            value = getattr(node, field, None)
            if isinstance(value, str):
                yield from _WORD.findall(value)
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from node.module.split(".")
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield from _WORD.findall(node.value)


def unknown_names(folder: Path) -> list[str]:
    """Names in backticks of which a part occurs nowhere in the code."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in folder.rglob("*.py")}
    known = {word for tree in trees.values() for word in _words(tree)}
    known |= {part for path in folder.rglob("*") if "__pycache__" not in path.parts for part in path.stem.split(".")}
    for path in folder.rglob("*.toml"):
        known.update(_WORD.findall(path.read_text(encoding="utf-8")))
    return [
        f"{path.relative_to(folder)}:{line} {name}"
        for path, tree in trees.items()
        for line, text in _docstrings(tree)
        for name in _NAME.findall(text)
        if name not in _FOREIGN and not set(name.split(".")) <= known
    ]


def test_what_docstrings_name_is_there():
    assert unknown_names(SOURCES) == []


def test_a_dead_name_would_be_seen(tmp_path):
    (tmp_path / "one.py").write_text('"""As `two.three` and `one` have it."""\n', encoding="utf-8")
    assert unknown_names(tmp_path) == ["one.py:1 two.three"]


def test_docstrings_of_functions_begin_with_a_verb():
    """Those of rules would begin with their codes."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in SOURCES.rglob("*.py")}
    functions = [
        (path, node) for path, tree in trees.items() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    assert [
        (path, function.name) for path, function in functions if re.match(r"[A-Z]\d", ast.get_docstring(function) or "")
    ] == []
