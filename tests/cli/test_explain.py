"""`kinertia explain`: codes, questions and families of the catalogue."""

import json

import pytest

from command_line import run
from kinertia.diagnostics.limits import with_limits
from kinertia.findings.rule import all_rules, matching, rule


def told(*arguments):
    outcome = run("explain", *arguments)
    assert outcome.status == 0, outcome.err
    return " ".join(outcome.out.split())


@pytest.mark.parametrize("code", ["P213", "p213", " P213 "])
def test_a_code_is_explained_in_full(code):
    text = told(code)
    one = with_limits(rule("P213"))
    for part in (one.code, one.name, one.severity, one.escalation, one.detects, one.effect, *one.causes, one.remedy):
        assert part in text
    assert "The zero of <plate> is off: it reads <level>" in text
    assert "{" not in text
    assert "docs/findings/force-plates.md#p213" in text
    assert all(explained in text for explained in one.supersedes)


@pytest.mark.parametrize("code", ["P21", "p21", "P"])
def test_a_question_or_family_lists_its_codes(code):
    text = told(code)
    assert "P21 Are the plates' zeros right?" in text
    for one in matching(code.upper()):
        assert f"{one} {rule(one).severity.lower()} {rule(one).name}" in text


@pytest.mark.parametrize(
    ("code", "ignored", "waived"),
    [
        ("M113", True, False),
        ("P213", True, True),
        ("P244", False, True),
        ("P278", False, False),
        ("P215", True, False),
        ("F148", True, False),
    ],
)
def test_it_says_how_a_finding_is_overruled(code, ignored, waived):
    text = told(code)
    assert (f'ignore = ["{code}"]' in text) == ignored
    assert (f"--waive {code}" in text) == waived
    assert ("cannot be waived, since" in text) == rule(code).hard


def test_it_says_that_what_a_reader_raises_cannot_be_waived():
    assert "cannot be waived where a file could not be read further" in told("P201")
    assert "cannot be waived" not in told("P244")


@pytest.mark.parametrize(("code", "expected"), [("P213", ("P213",)), ("P21", matching("P21")), ("P", matching("P"))])
def test_scripts_get_the_rules(code, expected):
    content = json.loads(run("explain", code, "--json").out)
    assert tuple(one["code"] for one in content) == expected
    one = content[0]
    assert one["message"] == rule(one["code"]).message
    assert one["supersedes"] == list(rule(one["code"]).supersedes)
    assert one["page"].endswith(f"#{one['code'].lower()}")


@pytest.mark.parametrize(("code", "near"), [("P2131", "P213"), ("plate-zero-ofset", "P213 (plate-zero-offset)")])
def test_an_unknown_code_is_an_error_that_names_the_nearest(code, near):
    outcome = run("explain", code)
    assert outcome.status == 2
    assert near in outcome.err
    assert len(outcome.err.splitlines()) == 1


def test_where_nothing_is_near_the_families_are_named():
    outcome = run("explain", "?")
    assert outcome.status == 2
    assert "F, M, L, P, T, S, O, R" in outcome.err


def test_every_code_can_be_explained_on_a_narrow_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    for code in all_rules():
        assert rule(code).name in told(code)
