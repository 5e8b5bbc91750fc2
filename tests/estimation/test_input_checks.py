from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.force_mass import force_mass
from kinertia.diagnostics.result.warnings import fit_warnings, force_warnings, mass_from_force_kg, two_level_warnings
from kinertia.errors import SettingsError, SubjectError, TrialError
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.input_checks import check_trials, complete_subject
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


def test_without_sex_there_is_no_table():
    with pytest.raises(SubjectError, match="S101") as caught:
        complete_subject(Subject(name="a", mass_kg=60.0, height_m=1.7), [WALK])
    assert caught.value.field == "sex"
    assert complete_subject(Subject(name="a", mass_kg=60.0), [WALK], mass_only=True).sex is None


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (("walk", "walk"), "trial 'walk': trial 'walk' is there already; results have a folder for each"),
        (("walk", "Walk"), "Windows and macOS take both for one folder"),
        (("walk", "../walk"), "a folder on every system has none of"),
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


def warned(fit, mass_kg=None, **changes):
    result = SimpleNamespace(**{"bsp": fit.literature, "converged": True, "evaluations": 7, **changes})
    mass = force_mass(fit.skeleton, fit.trials[0].kinematics.trial).mass_kg if mass_kg is None else mass_kg
    said = force_warnings(CarriedMass.of(mass, ()), fit.literature, fit.trials[:1], fit.skeleton)
    return said + fit_warnings(CarriedMass.of(mass, ()), fit.literature, result.bsp) + two_level_warnings(result)


def test_warnings_come_one_by_one(short_fit):
    literature = short_fit.literature
    by_force = force_mass(short_fit.skeleton, short_fit.trials[0].kinematics.trial).mass_kg
    fine = replace(literature, mass_kg=literature.mass_kg * by_force / literature.total_mass_kg)
    assert warned(short_fit, bsp=fine) == []
    assert any("did not converge within 7" in w for w in warned(short_fit, bsp=fine, converged=False))
    light = replace(fine, mass_kg=fine.mass_kg * 0.96)
    assert any("estimated total mass" in w and "-4.0 %" in w for w in warned(short_fit, bsp=light))
    assert any("mean vertical force" in w and "early" in w for w in warned(short_fit, by_force * 1.021, bsp=fine))
    far = replace(fine, com_m=literature.com_m + np.eye(12, 3) * 0.11)
    assert any("contradicts the literature" in w and "110 mm" in w for w in warned(short_fit, bsp=far))
    flat = fine.inertia_kgm2.copy()
    flat[2] = np.diag([1.0, 0.1, 0.1])
    (said,) = warned(short_fit, bsp=replace(fine, inertia_kgm2=flat))
    assert "physically impossible for 1 of 12 segments (thigh_r)" in said


def test_how_far_a_centre_of_mass_is_is_told_by_the_prior_where_there_is_one(short_fit):
    """A trunk may well be 104 mm off: its deviation is 34 mm."""
    literature, carried = short_fit.literature, CarriedMass.of(short_fit.literature.total_mass_kg, ())
    far = replace(literature, com_m=literature.com_m + np.eye(12, 3) * 0.104)
    assert any("moved by 104 mm" in w for w in fit_warnings(carried, literature, far))
    prior_sd = np.full((12, 10), 0.04)
    assert fit_warnings(carried, literature, far, prior_sd=prior_sd) == []
    assert any("moved by 104 mm" in w for w in fit_warnings(carried, literature, far, prior_sd=0.8 * prior_sd))


def test_a_motion_that_the_forces_do_not_make_accuses_inverse_kinematics_and_nobody_else(short_fit):
    trial, literature = short_fit.trials[0], short_fit.literature
    force = trial.kinematics.foot_loads[:, :, 1].sum(axis=1).mean()
    wrong = {**trial.residuals, "literature": trial.residuals["literature"] + 0.3 * force * np.eye(6)[1]}
    mass = CarriedMass.of(force_mass(short_fit.skeleton, trial.kinematics.trial).mass_kg, ())
    (said,) = force_warnings(mass, literature, [replace(trial, residuals=wrong)], short_fit.skeleton)
    assert "inverse kinematics went wrong, not the plates" in said
    assert force_warnings(mass, literature, [trial], short_fit.skeleton) == []
