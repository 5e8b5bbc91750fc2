"""Conditions and sessions of a cohort's people: who has both, what is kept, and what the tables hold."""

from dataclasses import replace

import numpy as np
import pytest

from command_line import run as command
from kinertia.cohort import paired
from kinertia.cohort.paired import Pair, PersonChanges, changes_of, changes_sentence, mean_parts, pairs_of
from kinertia.cohort.people import people_of
from kinertia.cohort.record import RECORD, Place, Record, inputs_of, standings
from kinertia.cohort.tables import read_cohort, write_tables
from kinertia.errors import FileError, KinertiaError, SettingsError
from kinertia.estimation.changes.change import Change
from kinertia.io.subject.reader import read_subject
from kinertia.io.versions import VERSION
from kinertia.report.comparison.what_changed import Comparison

pd = pytest.importorskip("pandas")
pytest.importorskip("pyarrow")

BOTH = ("before", "after")
SOURCES = dict.fromkeys(("instruments", "body", "markers", "stride"), 0.01)


def change(after, component="adduction", event="mid-stance", doubt=""):
    outcome = ("moment", "knee", component, "r", event, "N m/kg")
    return Change(*outcome, 0.5, after, (3, 3), 0.02, SOURCES, 0.05, 0.01, (0.1, np.nan), doubt=doubt)


@pytest.fixture
def study(tmp_path, c3d_lab):
    """A list of two people: one with two sessions, one with two conditions."""
    text = (c3d_lab / "subject.toml").read_text(encoding="utf-8")
    for name, condition in (("anna1", ""), ("anna2", ""), ("ben", "before")):
        subject = text.replace("[[trial]]", f'[[trial]]\ncondition = "{condition}"')
        if name == "ben":
            subject += f"\n[[trial]]{subject.split('[[trial]]')[1].replace('before', 'after')}"
            subject = subject.replace('condition = "after"', 'condition = "after"\nname = "second"')
        folder = tmp_path / name
        folder.mkdir()
        for file in c3d_lab.iterdir():
            if file.is_file():
                (folder / file.name).write_bytes(file.read_bytes())
        (folder / "subject.toml").write_text(subject, encoding="utf-8")
    rows = "name,session,subject\nAnna,before,anna1\nAnna,after,anna2\nBen,,ben\n"
    (tmp_path / "people.csv").write_text(rows, encoding="utf-8")
    return tmp_path / "people.csv"


def test_pairs_are_sessions_of_a_person_or_else_conditions(study, tmp_path):
    people = people_of(study, tmp_path / "out")
    assert [(participant.name, participant.person, participant.session) for participant in people] == [
        ("Anna before", "Anna", "before"), ("Anna after", "Anna", "after"), ("Ben", "Ben", ""),
    ]  # fmt: skip
    assert pairs_of(people, BOTH) == [Pair("Anna", ("Anna before", "Anna after")), Pair("Ben", ("Ben",))]
    assert pairs_of([*people[:2], replace(people[2], subject=None)], BOTH)[1] == Pair("Ben", ())
    assert pairs_of(people, ("after", "before"))[0] == Pair("Anna", ("Anna after", "Anna before"))
    with pytest.raises(SettingsError, match="stated are: after, before"):
        pairs_of(people, ("before", "later"))
    with pytest.raises(SettingsError):
        pairs_of(people, ("before", "before"))


def test_a_session_needs_a_name(study, tmp_path):
    study.write_text("session,subject\nbefore,anna1\n", encoding="utf-8")
    with pytest.raises(FileError, match="'name'"):
        people_of(study, tmp_path / "out")


def test_sessions_are_other_fits_than_single_people(study, tmp_path):
    first = next(iter(standings(people_of(study, tmp_path / "out"), tmp_path / "out")))
    wanted = read_subject(first.person.subject)
    assert first.inputs == inputs_of(wanted, "before") == inputs_of(wanted, "after") != inputs_of(wanted)


@pytest.fixture
def fitted(tmp_path, monkeypatch):
    """A cohort of three pairs with results; the comparisons are counted, Clara's fails."""
    calls = []

    def compare(before, after=None, conditions=None):
        calls.append((before.name, conditions))
        if before.name == "Clara":
            raise KinertiaError("no trial has the condition 'after'")
        number = {"Anna before": 0.3, "Ben": 0.2}[before.name]
        return Comparison(*BOTH, (change(number), change(number, "flexion", doubt="P213")), None)

    monkeypatch.setattr(paired, "compare", compare)
    monkeypatch.setattr(paired, "in_parallel", lambda task, cases, progress: [task(case) for case in cases])
    for name in ("Anna before", "Anna after", "Ben", "Clara"):
        folder = Place(tmp_path, name).results
        folder.mkdir(parents=True)
        (folder / RECORD).write_text(Record(name, 0, "", "9f", VERSION, 1, 1.0).text(), encoding="utf-8")
    pairs = [Pair("Anna", ("Anna before", "Anna after")), *(Pair(name, (name,)) for name in ("Ben", "Clara", "Dora"))]
    pairs.append(Pair("Emil", ()))
    return tmp_path, pairs, calls


def run(cohort, pairs):
    return changes_of(cohort, pairs, BOTH, lambda stage, share: None)


def test_one_failure_leaves_the_others_and_what_is_known_is_not_computed_again(fitted):
    cohort, pairs, calls = fitted
    found = run(cohort, pairs)
    assert [len(changed.changes) for changed in found] == [2, 2, 0, 0, 0]
    assert "no trial" in found[2].remarks
    assert found[3].remarks == "not fitted: Dora"
    assert found[4].remarks == "one of both is lacking"
    assert changes_sentence(found).startswith("2 of 5 people compared")
    assert "; Emil: one of both is lacking" in changes_sentence(found)
    assert calls == [("Anna before", None), ("Ben", BOTH), ("Clara", BOTH)]
    again = run(cohort, pairs)
    assert again[0].changes[0] == replace(found[0].changes[0], stride_sd=again[0].changes[0].stride_sd)
    assert again[1].columns()["difference"] == found[1].columns()["difference"]
    assert len(calls) == 4, "Clara only"
    record = Place(cohort, "Anna after").results / RECORD
    record.write_text(Record("Anna after", 0, "", "a0", VERSION, 1, 1.0).text(), encoding="utf-8")
    run(cohort, pairs)
    assert [name for name, _ in calls[4:]] == ["Anna before", "Clara"]


def test_tables_have_a_row_per_outcome_and_the_means(fitted):
    cohort, pairs, _ = fitted
    people = run(cohort, pairs)
    write_tables(cohort, [], False, {}, people)
    table = pd.read_csv(cohort / "changes.csv")
    assert table.person.tolist() == ["Anna", "Anna", "Ben", "Ben", "Clara", "Dora", "Emil"]
    assert table.difference[:4].tolist() == pytest.approx([-0.2, -0.2, -0.3, -0.3])
    assert table.verdict.tolist() == ["changed", "cannot be judged", "changed", *["cannot be judged"] * 4]
    assert table.remarks[1] == "P213"
    means = pd.read_csv(cohort / "change_means.csv")
    assert means[["people", "changed"]].to_numpy().tolist() == [[2, 2]]
    assert means.difference[0] == pytest.approx(-0.25)
    (part,) = mean_parts(people, BOTH)
    assert part.title == "before to after"
    assert part.rows[0][:3] == ("right knee adduction moment, mid-stance", "N m/kg", "2")
    tables = read_cohort(cohort)
    assert len(tables["changes"].compute()) == 7
    write_tables(cohort, [], False)
    assert len(pd.read_csv(cohort / "changes.csv")) == 0, "not those of an earlier run"
    assert not list(mean_parts((PersonChanges("Clara", remarks="none"),), BOTH))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--learn", "--conditions", "before", "after"), "--learn and --conditions"),
        (("--learn",), "--learn does not know sessions"),
        (("--conditions", "shod", "barefoot"), "nobody has sessions or conditions shod and barefoot"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_anybody_is_fitted(study, tmp_path, options, said):
    outcome = command("cohort", study, "-o", tmp_path / "out", *options)
    assert outcome.status == 2
    assert said in " ".join(outcome.err.split())
    assert not (tmp_path / "out").exists()
