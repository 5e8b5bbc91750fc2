"""Who has to be fitted again: whose files, settings or version changed, and nobody else."""

import shutil
from dataclasses import replace

import pytest

from kinertia.cohort.people import Participant
from kinertia.cohort.record import RECORD, Place, Record, keep, prepare_folder, standings
from kinertia.io.versions import VERSION


@pytest.fixture
def subject(c3d_lab, tmp_path):
    """A subject file of one's own to change."""
    shutil.copytree(c3d_lab, tmp_path / "Anna")
    return tmp_path / "Anna" / "subject.toml"


def standing(subject, cohort):
    (only,) = standings([Participant("Anna", subject)], cohort)
    return only


def record_of(standing, **changes):
    whole = Record("Anna", 0, "", standing.inputs, VERSION, standing.trials, 1.5)
    return replace(whole, **changes)


def put(cohort, record):
    folder = Place(cohort, record.person).results
    folder.mkdir(parents=True, exist_ok=True)
    (folder / RECORD).write_text(record.text(), encoding="utf-8")


def changed(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")


def test_only_what_changes_a_fit_is_a_change(subject, tmp_path):
    cohort = tmp_path / "out"
    first = standing(subject, cohort)
    assert (first.due, first.trials, first.problem) == (True, 1, "")
    assert first.frames > 100
    put(cohort, record_of(first))
    assert not standing(subject, cohort).due
    subject.write_text(subject.read_text(encoding="utf-8") + "\n# a remark\n", encoding="utf-8")
    moved = shutil.move(subject.parent, tmp_path / "elsewhere") / "subject.toml"
    assert not standing(moved, cohort).due
    changed(moved, "[model]", "[settings]\ncutoff_hz = 6.0\n[model]")
    assert standing(moved, cohort).due
    changed(moved, "[settings]\ncutoff_hz = 6.0\n", "")
    assert not standing(moved, cohort).due
    with (moved.parent / "walk.c3d").open("ab") as file:
        file.write(b"\0")
    assert standing(moved, cohort).due


def test_results_of_another_version_are_fitted_again(subject, tmp_path):
    before = standing(subject, tmp_path / "out")
    put(tmp_path / "out", record_of(before, kinertia="0.0.1"))
    assert standing(subject, tmp_path / "out").due


@pytest.mark.parametrize("text", ["", "{", "[]", '{"person": "Anna"}'])
def test_a_record_that_cannot_be_read_is_none(text, subject, tmp_path):
    put(tmp_path, record_of(standing(subject, tmp_path)))
    (Place(tmp_path, "Anna").results / RECORD).write_text(text)
    assert standing(subject, tmp_path).due


def test_failures_of_the_input_are_kept_until_it_changes_and_others_are_tried_again(subject, tmp_path):
    prepare_folder(tmp_path)
    before = standing(subject, tmp_path)
    keep(tmp_path, record_of(before, status=2, sentence="no plates"))
    again = standing(subject, tmp_path)
    assert not again.due
    assert again.outcome(None, tmp_path).sentence == "no plates"
    keep(tmp_path, record_of(before, status=70, sentence="killed", inputs=""))
    assert standing(subject, tmp_path).due
    put(tmp_path, record_of(before))
    keep(tmp_path, record_of(before))
    assert not Place(tmp_path, "Anna").failure.exists()
    assert standing(subject, tmp_path).outcome(None, tmp_path).fitted


def test_results_that_stay_of_other_files_are_told(subject, tmp_path):
    put(tmp_path, record_of(standing(subject, tmp_path)))
    changed(subject, "mass_kg", "mas_kg")
    before = standing(subject, tmp_path)
    assert not before.due
    outcome = before.outcome(None, tmp_path)
    assert (outcome.status, outcome.fitted) == (2, False)
    assert "F191 " in outcome.sentence
    assert outcome.sentence.endswith("(results of other files are in people/Anna)")


def test_who_is_there_twice_is_fitted_once(subject, tmp_path):
    """A copied folder has another name by default, and a list may name a file twice; other settings: another fit."""
    copy = tmp_path / "Anna - Copy" / "subject.toml"
    shutil.copytree(subject.parent, copy.parent)
    changed(copy, 'name = "', 'name = "Copy of ')
    people = [Participant("Anna", subject), Participant("Anna - Copy", copy), Participant("B", subject)]
    first, *twins = standings(people, tmp_path / "out")
    assert first.due
    assert [twin.due for twin in twins] == [False, False]
    assert all("the same files and settings as 'Anna'" in twin.problem for twin in twins)
    changed(copy, "[model]", "[settings]\ncutoff_hz = 6.0\n[model]")
    assert [person.due for person in standings(people[:2], tmp_path / "out")] == [True, True]


def test_logs_of_people_at_work_in_a_killed_run_are_swept(tmp_path):
    prepare_folder(tmp_path)
    for name in ("Anna.log", "Ben.log", "Ben.json"):
        (tmp_path / "failed" / name).write_text("run x", encoding="utf-8")
    prepare_folder(tmp_path)
    assert sorted(path.name for path in (tmp_path / "failed").iterdir()) == ["Ben.json", "Ben.log"]
