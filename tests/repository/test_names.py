"""Names say what a thing holds: `one`, `each`, `own` and `of` are names of nothing."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EMPTY = {"one", "each", "own", "of"}


def empty_names(path: Path) -> list[str]:
    """Variables, parameters, fields and functions of these names."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        name = {ast.arg: "arg", ast.FunctionDef: "name", ast.Name: "id"}.get(type(node))
        bound = not isinstance(node, ast.Name) or isinstance(node.ctx, ast.Store)
        is_method = (
            isinstance(node, ast.FunctionDef) and bool(node.args.args) and node.args.args[0].arg in ("cls", "self")
        )
        if name and bound and getattr(node, name) in EMPTY and not is_method:  # `Feet.of(...)` says what it is of
            found.append(f"{path.relative_to(ROOT)}:{node.lineno} {getattr(node, name)}")
    return found


@pytest.mark.parametrize("folder", ["src", "tests", "validation", "docs/tools", "release", "examples"])
def test_names_say_what_a_thing_holds(folder):
    assert [name for path in sorted((ROOT / folder).rglob("*.py")) for name in empty_names(path)] == []


def test_an_empty_name_would_be_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    (tmp_path / "a.py").write_text("def f(own):\n    return [one for one in own]\n")
    assert sorted(empty_names(tmp_path / "a.py")) == ["a.py:1 own", "a.py:2 one"]
