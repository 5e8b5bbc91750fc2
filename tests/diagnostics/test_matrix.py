"""Every code of the catalogue is made, with the evidence that its sentences need, and asserted by a test."""

import ast
import re
from functools import cache
from itertools import chain
from pathlib import Path

import pytest

from kinertia.findings.display import filled
from kinertia.findings.rule import all_rules
from kinertia.findings.where import Where
from template_names import names_in

ROOT = Path(__file__).parents[2]
RULES = all_rules()
PUT_TOGETHER = ("R301", "R302")
"""Their names of evidence are put together of a size and a unit, which `test_residuals` sees."""
ABOUT_CODES = ("findings", "report", "repository")
"""Tests of how findings are shown: that a code is in them says nothing about who finds it."""
UNFINDABLE = ("synthetic/mistakes.py", "studies")
"""They name codes that they expect, and make none."""


@cache
def constants(path):
    """Texts in quotes that are not docstrings, and names of arguments."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {id(one.value) for one in ast.walk(tree) if isinstance(one, ast.Expr)}
    texts = {
        one.value
        for one in ast.walk(tree)
        if isinstance(one, ast.Constant) and isinstance(one.value, str) and id(one) not in docstrings
    }
    return frozenset(texts | {one.arg for one in ast.walk(tree) if isinstance(one, ast.keyword) and one.arg})


def makers(code):
    """Modules of the program that name a code."""
    package = ROOT / "src" / "kinertia"
    paths = (path for path in package.rglob("*.py") if not path.relative_to(package).as_posix().startswith(UNFINDABLE))
    return [path for path in sorted(paths) if code in constants(path)]


def evidence_needed(code):
    """What its sentences need besides the place."""
    names = chain.from_iterable(
        names_in(text) for text in (RULES[code].message, RULES[code].effect, RULES[code].remedy)
    )
    return {name for name in names if "{" in filled("{" + name + "}", Where(), {})}


def test_every_code_is_made():
    assert [code for code in RULES if not makers(code)] == []


def test_every_code_that_is_made_is_in_the_catalogue():
    package = ROOT / "src" / "kinertia"
    named = {
        text for path in package.rglob("*.py") for text in constants(path) if re.fullmatch(r"[FMLPTSOR]\d{3}", text)
    }
    assert named <= RULES.keys()


def test_every_code_is_asserted_by_a_test():
    tests = ROOT / "tests"
    paths = (path for path in tests.rglob("test_*.py") if path.relative_to(tests).parts[0] not in ABOUT_CODES)
    asserted = {
        code for path in paths if path != Path(__file__) for text in constants(path) for code in _codes_in(text)
    }
    assert [code for code in RULES if code not in asserted] == []


def _codes_in(text):
    return re.findall(r"\b[FMLPTSOR]\d{3}\b", text)


@pytest.mark.parametrize("code", sorted(RULES.keys() - set(PUT_TOGETHER)))
def test_what_sentences_need_is_passed(code):
    """By the module that makes it, or one that it imports from the same room."""
    needed = evidence_needed(code)
    assert needed <= chained(makers(code)), code


def chained(paths):
    """Texts and arguments of modules, and of those of their own that they import."""
    package = ROOT / "src"
    known = set(paths)
    for path in paths:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        modules = {one.module for one in ast.walk(tree) if isinstance(one, ast.ImportFrom) and one.module}
        imported = {(package / Path(*module.split("."))).with_suffix(".py") for module in modules}
        known |= {one for one in imported if one.is_file()}
    return set(chain.from_iterable(constants(path) for path in known))


def direct_calls():
    """`finding("P213", where, level_n=...)`: path and line, code, and names of evidence that are all there is."""
    for path in sorted((ROOT / "src" / "kinertia").rglob("*.py")):
        for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(one, ast.Call) and isinstance(one.func, ast.Name) and one.func.id == "finding":
                names = {each.arg for each in one.keywords}
                if isinstance(one.args[0], ast.Constant) and None not in names:
                    yield f"{path.name}:{one.lineno}", one.args[0].value, names


def test_findings_made_in_place_have_what_their_sentences_need():
    calls = list(direct_calls())
    assert len(calls) > 50
    lacking = {where: evidence_needed(code) - names for where, code, names in calls}
    assert {where: names for where, names in lacking.items() if names} == {}
