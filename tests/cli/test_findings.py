"""Findings on a terminal."""

import json
from dataclasses import replace

import pytest

from command_line import run
from found import CORRECTED, UNEXPLAINED, UNUSABLE, WAIVED, ZERO
from generic_static import recording, standing_positions
from kinertia.cli.common import out
from kinertia.cli.findings import next_commands, show_all, show_overview
from kinertia.diagnostics.limits import with_limits
from kinertia.errors import MarkerSetError, SubjectError
from kinertia.findings.finding import finding
from kinertia.findings.overview import Overview
from kinertia.findings.quantity import Where
from kinertia.findings.rule import all_rules, matching, rule
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.subject.tables import Model
from kinertia.model.gait27 import build_gait27


def test_verbose_shows_what_a_finding_explains_to_the_last_consequence_and_in_its_own_trial_only():
    last = finding("P246", Where(trial="walk", plate="plate 1")).muted("P214")
    elsewhere = replace(ZERO, where=replace(ZERO.where, trial="run"))
    with out.capture() as shown:
        show_all([ZERO, UNEXPLAINED, last, elsewhere])
    codes = [line.split()[:3] for line in shown.get().splitlines() if "P2" in line]
    assert codes == [
        ["WARNING", "walk", "P213"],
        ["explains", "walk", "P214"],
        ["explains", "walk", "P246"],
        ["WARNING", "run", "P213"],
    ]


@pytest.mark.parametrize(
    ("findings", "codes", "hidden"),
    [
        (UNUSABLE, ["R301", "P244", "M113"], "3 more and 1 assumption"),
        ((*CORRECTED, ZERO, WAIVED), ["P244", "P213", "T214"], "1 more:"),
    ],
)
def test_the_worst_three_are_shown_waived_errors_among_them(findings, codes, hidden):
    with out.capture() as shown:
        show_overview(Overview(findings, 0, 1), verbose=False)
    lines = shown.get().splitlines()
    assert [next(code for code in codes if code in line) for line in lines[1:4]] == codes
    assert lines[4].startswith(hidden)


COMMAND = "kinertia fit walk.c3d --static static.c3d"


def no_preset():
    with pytest.raises(MarkerSetError) as error:
        choose_marker_set(["A", "B"])
    return error.value


def no_landmark():
    positions = {label: at for label, at in standing_positions().items() if label != "R.Heel"}
    with pytest.raises(MarkerSetError) as error:
        build_gait27(recording(positions), read_marker_set("cleveland-clinic"), 1.75, "male")
    return error.value


def model(**more):
    return Model.model_construct(**{"static": None, "markers": None, "osim": None, **more})


@pytest.mark.parametrize("error", [no_preset, no_landmark])
def test_options_lead_to_two_commands(tmp_path, monkeypatch, error):
    monkeypatch.chdir(tmp_path)
    lines = next_commands(error(), tmp_path / "walk.c3d", model(static=tmp_path / "static.c3d"), COMMAND)
    assert lines == ["kinertia markers static.c3d -o markers.toml", f"{COMMAND} --markers markers.toml"]


def test_a_subject_file_gets_the_marker_set_beside_it(tmp_path):
    wanted = model(static=tmp_path / "static.c3d")
    lines = next_commands(no_preset(), tmp_path / "subject.toml", wanted, "kinertia fit subject.toml")
    assert lines[0].endswith(f"-o {tmp_path / 'markers.toml'}")
    assert 'markers = "markers.toml" under [model]' in lines[1]
    assert lines == next_commands(no_preset(), tmp_path, wanted, "kinertia fit subject.toml")


def test_nothing_is_said_where_it_would_not_help(tmp_path):
    static = {"static": tmp_path / "static.c3d"}
    walk = tmp_path / "walk.c3d"
    assert next_commands(SubjectError("mass_kg", 0, "give one"), walk, model(**static), COMMAND) == []
    assert next_commands(no_preset(), walk, model(), COMMAND) == []
    assert next_commands(no_preset(), walk, model(**static, markers=tmp_path / "own.toml"), COMMAND) == []


def told(*arguments):
    outcome = run("explain", *arguments)
    assert outcome.status == 0, outcome.err
    return " ".join(outcome.out.split())


@pytest.mark.parametrize("code", ["P213", "p213", " P213 "])
def test_a_code_is_explained_in_full(code):
    text = told(code)
    explained_rule = with_limits(rule("P213"))
    for part in (
        explained_rule.code,
        explained_rule.name,
        explained_rule.severity,
        explained_rule.escalation,
        explained_rule.detects,
        explained_rule.effect,
        *explained_rule.causes,
        explained_rule.remedy,
    ):
        assert part in text
    assert "The zero of <plate> is off: it reads <level>" in text
    assert "{" not in text
    assert "docs/findings/force-plates.md#p213" in text
    assert all(explained in text for explained in explained_rule.supersedes)


@pytest.mark.parametrize("code", ["P21", "p21", "P"])
def test_a_question_or_family_lists_its_codes(code):
    text = told(code)
    assert "P21 Are the plates' zeros right?" in text
    for known in matching(code.upper()):
        assert f"{known} {rule(known).severity.lower()} {rule(known).name}" in text


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
    assert tuple(reported["code"] for reported in content) == expected
    reported = content[0]
    assert reported["message"] == rule(reported["code"]).message
    assert reported["supersedes"] == list(rule(reported["code"]).supersedes)
    assert reported["page"].endswith(f"#{reported['code'].lower()}")


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


@pytest.mark.slow
def test_every_code_can_be_explained_on_a_narrow_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    for code in all_rules():
        assert rule(code).name in told(code)
