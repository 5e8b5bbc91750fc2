"""Remedies of findings: each writes the setting that a user would type, is shown, and can be undone."""

import json
import shutil

import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")

from kinertia.cli.web.entries import entries, recognise, write_form
from kinertia.cli.web.library import Library
from kinertia.cli.web.remedies import Button, applied, apply, undo
from kinertia.errors import SettingsError
from kinertia.findings.remedy import Remedy
from kinertia.io.subject.reader import read_subject

TRIALS = ("walk.c3d", "walk 2.c3d")
WAIVE = Remedy("diagnostics", "waive", "P244", "walk")
IGNORE = Remedy("diagnostics", "ignore", "S111")
SETTINGS = (
    Remedy("subject", "mass_kg", 46.12),
    Remedy("subject", "population", "child"),
    Remedy("model", "static"),
    Remedy("model", "window_s", [0.0, 0.1]),
    Remedy("trial", "", None, "walk"),
    Remedy("trial", "window_s", [0.6, 1.4], "walk"),
    Remedy("trial", "leave_out", ["LANK"], "walk 2"),
    Remedy("instruments", "zeroed", True),
    WAIVE,
    IGNORE,
)


@pytest.fixture
def person(tmp_path, c3d_lab):
    made = Library(tmp_path / "library").add("Anna")
    shutil.copyfile(c3d_lab / "static.c3d", made.folder / "static.c3d")
    for name in TRIALS:
        shutil.copyfile(c3d_lab / "walk.c3d", made.folder / name)
    recognise(made)
    write_form(made, {"sex": "male", "mass_kg": "72.6", "height_m": "1.803"})
    return made


def proposing(person, *remedies):
    """The person after a check that proposes these."""
    person.check.mkdir(exist_ok=True)
    fresh = Library(person.folder.parent).person(person.name)
    found = [{"settings": [remedy.to_dict() for remedy in remedies]}]
    (person.check / "outcome.json").write_text(json.dumps({"inputs": fresh.inputs, "findings": found}))
    return fresh


@pytest.mark.parametrize("remedy", SETTINGS, ids=lambda remedy: remedy.text)
def test_a_remedy_is_applied_shown_and_undone(person, remedy):
    before = entries(person)
    apply(proposing(person, *SETTINGS), remedy.text, "for a test")
    after = entries(person)
    assert after != before
    read_subject(person.subject)
    (shown,) = applied(person, after)
    assert shown.text == remedy.text
    assert shown.reason == "for a test"
    undo(person, remedy.text)
    assert sorted(entries(person)["trial"], key=str) == sorted(before["trial"], key=str)
    assert {**entries(person), "trial": 0} == {**before, "trial": 0}
    assert applied(person, entries(person)) == []


def test_what_is_written_is_what_a_user_would_type(person):
    for remedy in (WAIVE, IGNORE, *SETTINGS[5:7]):
        apply(proposing(person, remedy), remedy.text, "a known fault")
    wanted = read_subject(person.subject)
    walk, other = sorted(wanted.trials, key=lambda trial: len(trial.name))
    assert walk.diagnostics.overrule.waive == ("P244",)
    assert walk.diagnostics.overrule.reason("P244") == "a known fault"
    assert walk.window_s == (0.6, 1.4)
    assert other.leave_out == ("LANK",)
    assert wanted.diagnostics.ignore == ("S111",)
    assert len(applied(person, entries(person))) == 4
    write_form(person, {"start:walk.c3d": "0.5", "end:walk.c3d": "1.4"})
    assert len(applied(person, entries(person))) == 3, "typed over: no longer the button's"


def test_two_codes_are_overruled_and_one_of_them_again_counts(person):
    other = Remedy("diagnostics", "ignore", "S401")
    for remedy in (IGNORE, other):
        apply(proposing(person, remedy), remedy.text, f"because of {remedy.value}")
    undo(person, IGNORE.text)
    assert entries(person)["diagnostics"] == {"ignore": ["S401"], "reasons": {"S401": "because of S401"}}


def test_a_trial_that_was_left_out_comes_back_with_its_entries(person):
    write_form(person, {"condition:walk.c3d": "with orthosis"})
    remedy = Remedy("trial", "", None, "walk")
    apply(proposing(person, remedy), remedy.text, "")
    assert [trial.name for trial in read_subject(person.subject).trials] == ["walk 2"]
    undo(person, remedy.text)
    assert {trial.name: trial.condition for trial in read_subject(person.subject).trials} == {
        "walk": "with orthosis",
        "walk 2": "",
    }


def test_what_nobody_proposes_or_lacks_a_reason_is_refused(person):
    before = entries(person)
    with pytest.raises(SettingsError, match="earlier check"):
        apply(proposing(person, WAIVE), IGNORE.text, "x")
    with pytest.raises(SettingsError, match="P244"):
        apply(proposing(person, WAIVE), WAIVE.text, "  ")
    proposing(person, WAIVE)
    write_form(person, {"mass_kg": "70"})
    stale = Library(person.folder.parent).person(person.name)
    with pytest.raises(SettingsError, match="earlier check"):
        apply(stale, WAIVE.text, "x")
    write_form(person, {"mass_kg": "72.6"})
    assert entries(person) == before


def test_buttons_have_words_of_their_own():
    buttons = [Button.of(setting.to_dict()) for setting in SETTINGS]
    assert len({button.label for button in buttons}) == len(SETTINGS)
    assert [button.overrules for button in buttons] == [setting in (WAIVE, IGNORE) for setting in SETTINGS]
