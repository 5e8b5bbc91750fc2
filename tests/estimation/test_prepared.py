from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.result.soundness import mass_from_force_kg
from kinertia.errors import SettingsError, SubjectError, TrialError
from kinertia.estimation.prepared import check_trials, complete_subject
from kinertia.settings import Subject
from kinertia.trial.data import Markers, Recording

MARKERS = Markers(np.array([0.0, 0.1]), ("A",), np.zeros((2, 1, 3)))
STATIC = Recording("static", MARKERS, mass_kg=60.0, height_m=1.7)
WALK = Recording("walk", MARKERS)


def test_files_fill_in_what_the_user_left_out():
    subject = complete_subject(Subject(name="a", sex="female"), [WALK, STATIC])
    assert (subject.mass_kg, subject.height_m) == (60.0, 1.7)


def test_the_user_goes_before_the_files():
    subject = complete_subject(Subject(name="a", sex="female", mass_kg=61.0), [WALK, STATIC])
    assert (subject.mass_kg, subject.height_m) == (61.0, 1.7)


@pytest.mark.parametrize(("field", "quantity"), [("mass_kg", "mass"), ("height_m", "stature")])
def test_nobody_states_it(field, quantity):
    known = {"mass_kg": 60.0, "height_m": 1.7}
    del known[field]
    with pytest.raises(SubjectError) as caught:
        complete_subject(Subject(name="a", sex="male", **known), [WALK])
    assert caught.value.field == field
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("S101", quantity)


def test_all_that_nobody_states_is_said_at_once():
    with pytest.raises(SubjectError) as caught:
        complete_subject(Subject(name="a"), [WALK])
    assert caught.value.finding.evidence["quantity"].value == "mass, stature, sex"


def test_without_sex_there_is_no_table():
    with pytest.raises(SubjectError, match="S101") as caught:
        complete_subject(Subject(name="a", mass_kg=60.0, height_m=1.7), [WALK])
    assert caught.value.field == "sex"
    assert complete_subject(Subject(name="a", mass_kg=60.0), [WALK], mass_only=True).sex is None


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (("walk", "walk"), "trial 'walk': trial 'walk' is there already; results have a folder for each"),
        (("walk", "Walk"), "Windows and macOS treat both as one folder"),
        (("walk", "../walk"), "folders cannot have it on every system"),
        (("walk", "bsp.csv"), "the results have a file bsp.csv"),
    ],
)
def test_several_trials_have_names_of_their_own(names, problem):
    with pytest.raises(TrialError, match=problem):
        check_trials([replace(WALK, name=name) for name in names])
    check_trials([replace(WALK, name="../walk")])


def test_no_trial():
    with pytest.raises(SettingsError, match="S301"):
        check_trials([])


def test_a_file_with_an_impossible_mass():
    with pytest.raises(SubjectError, match=r"mass_kg = 0.*S102"):
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
