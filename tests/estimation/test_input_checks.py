from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.masses import mass_from_force_kg
from kinertia.errors import SettingsError, SubjectError, TrialError
from kinertia.estimation.input_checks import check_same_person, check_trials, complete_subject
from kinertia.settings import Subject
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FootLoads, Markers, Recording, Trial

MARKERS = Markers(np.array([0.0, 0.1]), ("A",), np.zeros((2, 1, 3)))
STATIC = Recording("static", MARKERS, mass_kg=60.0, height_m=1.7)
WALK = Recording("walk", MARKERS)


def test_files_fill_in_what_the_user_left_out():
    subject, warnings = complete_subject(Subject(name="a", sex="female"), [WALK, STATIC])
    assert (subject.mass_kg, subject.height_m) == (60.0, 1.7)
    assert warnings == []


@pytest.mark.parametrize(("mass", "warned"), [(60.5, False), (61.0, True), (59.0, True)])
def test_the_user_goes_before_the_files_and_disagreement_is_told(mass, warned):
    subject, warnings = complete_subject(Subject(name="a", sex="female", mass_kg=mass), [WALK, STATIC])
    assert (subject.mass_kg, subject.height_m) == (mass, 1.7)
    assert [("static" in w and "60" in w and f"{mass:g}" in w) for w in warnings] == [True] * warned


def test_files_that_disagree_with_each_other_are_told():
    other = Recording("second", MARKERS, mass_kg=66.0)
    subject, (warning,) = complete_subject(Subject(name="a", sex="female"), [STATIC, other])
    assert subject.mass_kg == 60.0
    assert "second" in warning
    assert "66" in warning


@pytest.mark.parametrize(("field", "option"), [("mass_kg", "--mass"), ("height_m", "--height")])
def test_nobody_tells(field, option):
    known = {"mass_kg": 60.0, "height_m": 1.7}
    del known[field]
    with pytest.raises(SubjectError, match=option) as caught:
        complete_subject(Subject(name="a", sex="male", **known), [WALK])
    assert caught.value.field == field


def test_without_sex_there_is_no_table():
    with pytest.raises(SubjectError, match=r"male or female.*--sex") as caught:
        complete_subject(Subject(name="a", mass_kg=60.0, height_m=1.7), [WALK])
    assert caught.value.field == "sex"
    assert complete_subject(Subject(name="a", mass_kg=60.0), [WALK], mass_only=True)[0].sex is None


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (("walk", "walk"), "trial 'walk': trial 'walk' is there already; results have a folder for each"),
        (("walk", "Walk"), "Windows and macOS take both for one folder"),
        (("walk", "../walk"), "must be a name that a folder can have on every system"),
        (("walk", "bsp.csv"), "the results have a file bsp.csv"),
    ],
)
def test_several_trials_have_names_of_their_own(names, problem):
    with pytest.raises(TrialError, match=problem):
        check_trials([replace(WALK, name=name) for name in names])
    check_trials([replace(WALK, name="../walk")])


def test_no_trial():
    with pytest.raises(SettingsError, match="no trial"):
        check_trials([])


def test_a_file_with_an_impossible_mass():
    with pytest.raises(SubjectError, match="mass_kg = 0"):
        complete_subject(Subject(name="a", sex="male"), [Recording("static", MARKERS, mass_kg=0.0, height_m=1.7)])


def test_mass_by_force_knows_the_movement_of_the_body(short_fit):
    """It must not change when the literature's mass does: the residual changes with it."""
    trial, literature = short_fit.trials[0], short_fit.literature
    measured = mass_from_force_kg(literature, trial)
    force = trial.kinematics.foot_loads[:, :, 1].sum(axis=1).mean()
    # at the same accelerations a body 10 % heavier needs 10 % more force
    heavier = trial.residuals["literature"].copy()
    heavier[:, 1] += 0.1 * (force + trial.residuals["literature"][:, 1].mean())
    other = SimpleNamespace(kinematics=trial.kinematics, residuals={"literature": heavier})
    body = SimpleNamespace(total_mass_kg=1.1 * literature.total_mass_kg)
    assert mass_from_force_kg(body, other) == pytest.approx(measured)
    assert 68 < measured < 77


def two_trials(stretch_m=0.0, label="R.Shank.Rear"):
    made = walk(walking_subject(), 0.3)
    trials = []
    for name, more in (("one", 0.0), ("two", stretch_m)):
        positions = made.markers.positions.copy()
        positions[:, made.markers.labels.index(label), 1] += more
        loads = FootLoads(made.time, made.foot_loads[..., :3], made.foot_loads[..., 3:])
        trials.append(Trial(name, replace(made.markers, positions=positions), loads, np.ones(len(made.time), bool)))
    return made.skeleton, trials


def test_trials_of_one_person_may_differ_a_little():
    check_same_person(*two_trials(0.03))


def test_trials_of_different_people_are_not_pooled():
    with pytest.raises(TrialError, match=r"trial 'two'.*R\.Shank\.Rear.*mm apart, in 'one' \d+ mm; pool only"):
        check_same_person(*two_trials(-0.08))
