"""What is compared is read, and refused, before anything is estimated; what limits a comparison is stated."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

import kinertia
from command_line import run
from kinertia.errors import FileError, KinertiaError
from kinertia.estimation.changes.change import PRIMARY, Change
from kinertia.estimation.changes.session_changes import one_session_note, tasks_note
from kinertia.estimation.result.fit import Fit
from kinertia.io.subject.tables import SubjectFile
from kinertia.report.comparison import what_changed
from kinertia.report.comparison.change_tables import (
    change_columns,
    change_sentences,
    changes_summary,
    lacking_sentence,
    shown_changes,
)
from kinertia.report.comparison.what_changed import opened
from kinertia.report.figures.coordinate_titles import outcome_signs


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes subject files that state these conditions; nothing may be estimated from them."""

    def never(*_):
        raise AssertionError("an estimate was begun")

    monkeypatch.setattr(what_changed, "fit_subject", never)
    monkeypatch.setattr(what_changed, "fit_session", never)

    (tmp_path / "static.trc").write_text("markers")

    def written(name, *conditions, content=None, sex="male"):
        lines = ["[subject]", f'sex = "{sex}"', "mass_kg = 70.0", "height_m = 1.75", "[model]", 'static = "static.trc"']
        for k, condition in enumerate(conditions):
            file = f"{name} {k}.trc" if content is None else f"{content} {k}.trc"
            (tmp_path / file).write_text(f"markers of {file}")
            (tmp_path / "forces.mot").write_text("forces")
            lines += ["[[trial]]", f'markers = "{file}"', 'forces = "forces.mot"']
            lines += [f'condition = "{condition}"'] if condition else []
        path = tmp_path / f"{name}.toml"
        path.write_text("\n".join(lines))
        return path

    return written


def test_conditions_are_looked_for_before_anything_is_estimated(write):
    path = write("Anna", "normal", "toe out")
    for conditions, named in (
        (("normal", "toe-out"), "'toe out'"),
        (("normal", "normal"), "choose two"),
        (("normal", "quite another"), "stated are: normal, toe out"),
    ):
        with pytest.raises(KinertiaError, match=named):
            kinertia.compare(path, conditions=conditions)
    with pytest.raises(KinertiaError, match=r"\[\[trial\]\]"):
        kinertia.compare(write("Ben", "", ""), conditions=("normal", "toe out"))
    with pytest.raises(KinertiaError, match="choose by --conditions"):
        kinertia.compare(path, write("later", "normal"))
    with pytest.raises(KinertiaError, match="no trial of"):
        kinertia.compare(path, write("latest", "normal"), conditions=("toe out", "toe out"))
    (source,) = opened([path], ("normal", "toe out"))
    assert isinstance(source, SubjectFile)


def test_subject_files_with_a_recording_in_common_are_refused(write):
    first, other = write("first", "", ""), write("other", "", content="first")
    with pytest.raises(FileError) as error:
        opened([first, other], None)
    assert error.value.path.name == "first 0.trc"
    with pytest.raises(KinertiaError, match="male and female"):
        opened([first, write("another", "", sex="female")], None)


def test_a_folder_of_results_or_with_a_subject_file_is_found(write, tmp_path, demo_run):
    path = write("subject", "")
    results = demo_run[1]
    found = opened([tmp_path, results], None)
    assert isinstance(found[0], SubjectFile)
    assert isinstance(found[1], Fit)
    assert isinstance(opened([results / "fit.npz", path], None)[0], Fit)
    with pytest.raises(FileError, match="kinertia init"):
        opened([tmp_path / "subject 0.trc", path], None)


def test_norms_are_read_before_anything_is_estimated(write, tmp_path):
    path = write("Anna", "normal", "toe out")
    with pytest.raises(FileError) as error:
        kinertia.compare(path, conditions=("normal", "toe out"), norms=tmp_path / "norms.csv")
    assert error.value.path.name == "norms.csv"
    outcome = run(
        "compare",
        path,
        write("Anna again", "normal"),
        "--conditions",
        "normal",
        "normal",
        "--norms",
        tmp_path / "norms.csv",
        "-o",
        tmp_path / "c",
        "--json",
    )
    assert "norms.csv" in json.loads(outcome.out)["error"]


def test_the_command_says_what_to_give_instead(write, tmp_path):
    path = write("Anna", "normal", "toe out")
    for arguments, named in (
        ((path,), "--conditions"),
        ((path, path), "give it once"),
        ((path, "toe in", "--conditions", "normal", "toe out"), "--conditions takes two names"),
        ((path, "--conditions", "normal"), "--conditions takes two names, here 'normal' and '-o'"),
        ((path, tmp_path / "nobody.toml"), "F101"),
    ):
        outcome = run("compare", *arguments, "-o", tmp_path / "c", "--json")
        assert outcome.status == 2
        assert named in json.loads(outcome.out)["error"]
        assert not (tmp_path / "c").exists()


def changed(side, wanted, p=0.5, difference=0.0):
    quantity, joint, component, event = wanted
    named = quantity, joint, component, side, event, "N m/kg"
    return Change(
        *named,
        0.3,
        0.3 + difference,
        (3, 3),
        0.02,
        dict.fromkeys(("instruments", "body", "markers"), 0.0) | {"stride": 0.02},
        0.05,
        p,
        (0.03, 0.03),
    )


def test_a_leg_whose_moments_are_not_known_is_named():
    right = [changed("r", wanted) for wanted in PRIMARY]
    assert lacking_sentence([*right, *(changed("l", wanted) for wanted in PRIMARY)]) == ""
    assert "left knee adduction (mid-stance, late stance) and ankle flexion (push-off)" in lacking_sentence(right)
    assert "right" not in lacking_sentence(right)
    some = [*right, changed("l", PRIMARY[0])]
    assert "mid-stance" not in lacking_sentence(some)


@pytest.mark.parametrize(
    ("convention", "knee", "ankle", "tilt"),
    [
        (
            "clinical",
            ("external knee adduction", -1.0),
            ("ankle plantarflexion", -1.0),
            ("pelvic tilt, anterior", -1.0),
        ),
        ("isb", ("knee adduction", 1.0), ("ankle dorsiflexion", 1.0), ("pelvic tilt, posterior", 1.0)),
        ("opensim", ("knee adduction", 1.0), ("ankle dorsiflexion", 1.0), ("pelvis tilt, backward", 1.0)),
    ],
)
def test_sentences_and_pages_have_the_signs_of_the_convention(fit, convention, knee, ankle, tilt):
    signs = outcome_signs(replace(fit, settings=fit.settings.model_copy(update={"convention": convention})))
    assert signs["moment", "knee", "adduction", "l"] == knee
    assert signs["moment", "ankle", "flexion", "r"] == ankle
    assert signs["angle", "pelvis", "tilt", "r"] == tilt
    as_stored = changed("r", PRIMARY[2])
    (shown,) = shown_changes([as_stored], signs)
    assert (shown.before, shown.difference) == (ankle[1] * as_stored.before, ankle[1] * as_stored.difference)
    assert (shown.verdict, shown.primary) == (as_stored.verdict, True)
    assert f"{ankle[0]} moment" in next(change_sentences([shown])).lower()


def test_what_keeps_an_outcome_from_being_judged_is_in_its_sentence():
    known = changed("r", PRIMARY[0])
    for doubt, named in (
        ("P282: beside the plate. P213: offset", "P282, P213"),
        ("Masses differ: one person?", "person"),
    ):
        (sentence,) = change_sentences([replace(known, doubt=doubt)])
        assert named in sentence
        assert "cannot be judged" in sentence
    single = replace(known, sd=float("nan"))
    for doubt, stated in (("Masses differ: one person? State ages.", False), ("their models differ", True)):
        (sentence,) = change_sentences([replace(single, doubt=doubt)])
        assert (doubt in sentence) is stated, "a note of several sentences is stated by itself"


def test_each_outcome_says_whether_it_remains_among_many():
    """Primary outcomes are judged alone; of the others 0.03 fails beside three that show nothing."""
    others = [("moment", "hip", "flexion", event) for event in ("loading", "mid-stance", "late stance", "push-off")]
    found = [changed("r", PRIMARY[0], 0.01, 0.2)]
    found += [changed("r", wanted, p) for wanted, p in zip(others, (0.001, 0.03, 0.6, 0.7), strict=True)]
    expected = [None, True, False, False, False]
    assert change_columns(found)["discovered"] == expected
    assert [row["discovered"] for row in changes_summary("a", "b", found, None, ())["outcomes"]] == expected


def test_subject_files_of_one_session_are_better_compared_by_conditions(write, tmp_path, demo_run):
    first, other = opened([write("first", ""), write("other", "")], None)
    assert "--conditions" in one_session_note([first, other])
    (tmp_path / "later.trc").write_text("markers put on anew")
    later = other.model_copy(update={"model": other.model.model_copy(update={"static": tmp_path / "later.trc"})})
    assert one_session_note([first, later]) == ""
    assert one_session_note([first, *opened([demo_run[1], first], None)[:1]]) == ""


def test_tasks_that_differ_are_noted():
    def walks(*tasks):
        return [SimpleNamespace(kinematics=SimpleNamespace(trial=SimpleNamespace(task=task))) for task in tasks]

    assert tasks_note((walks("walk", "walk"), walks("walk"))) == ""
    assert "walk before, turn after" in tasks_note((walks("walk"), walks("turn")))
    assert "turn and walk" in tasks_note((walks("walk", "turn"), walks("turn", "walk")))
