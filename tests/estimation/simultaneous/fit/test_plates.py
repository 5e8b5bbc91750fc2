"""What `fit_simultaneous` finds of force plates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinertia.estimation.simultaneous.fit import compared_with
from kinertia.estimation.simultaneous.instruments.priors import (
    DELAY_PRIOR_S,
    FLOOR_PRIOR,
    JOINT_CENTRE_SD_M,
    PLATE_PRIOR,
)
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.ground_contact import centre_of_pressure
from kinertia.trial.sampled_data import runs
from results import entry_of, of_estimate
from short_walk_fit import estimated, fitted, seen


def test_calibration_is_told_with_its_deviations(plain):
    hip, plate = (
        entry_of(plain, "centre change", joint="hip_r", axis="x"),
        entry_of(plain, "position", plate="right foot", axis="x"),
    )
    assert (hip.prior_sd, hip.moved) == (JOINT_CENTRE_SD_M, None)
    assert plate.prior_sd == pytest.approx(np.hypot(PLATE_PRIOR["x"].sd, FLOOR_PRIOR["x"].sd))
    assert entry_of(plain, "gain", plate="left foot").prior_sd == PLATE_PRIOR["gain"].sd
    delay = entry_of(plain, "delay")
    assert (delay.prior_sd, delay.unit) == (DELAY_PRIOR_S.sd, "s")
    assert delay.contradicted_by is None
    assert len({error.key for error in plain.posterior.calibration}) == len(plain.posterior.calibration)
    for error in plain.posterior.calibration:
        assert 0 < error.sd <= error.prior_sd * (1 + 1e-9), error


def test_a_displaced_plate_is_named(trial):
    def shift(positions, loads):
        loads[:, 0, 3:] += np.cross([0.0, 0.0, 0.03], loads[:, 0, :3])

    outcome = fitted(trial, disturb=shift)
    (found,) = [finding for finding in of_estimate(outcome) if finding.code == "P246"]
    assert (found.where.plate, found.where.axis, found.causes) == ("right foot", "mediolateral", ("the instrument",))
    assert found.evidence["offset_m"].value > 0.0


def longest_load(vertical):
    """First and last frame of the longest contact."""
    return max(runs(vertical > 20.0), key=lambda span: span[1] - span[0])


def test_a_wrong_gain_is_named(trial, plain):
    def weaken(positions, loads):
        loads[:, 0] *= 0.9

    outcome = fitted(trial, disturb=weaken)
    (found,) = [finding for finding in of_estimate(outcome) if finding.code == "P223"]
    assert (found.where.plate, found.where.trial) == ("right foot", "walk")
    assert found.evidence["gain_error"].value == pytest.approx(-0.1, abs=0.03)
    where = {"plate": "right foot", "trial": "walk"}
    entry = entry_of(outcome, "gain", **where)
    assert entry.value == found.evidence["gain_error"].value == pytest.approx(-0.1, abs=3.0 * entry.sd)
    assert entry.sd < 0.012
    assert outcome.posterior.missing_loads == ()

    assert compared_with(outcome, outcome).posterior.calibration == outcome.posterior.calibration
    alone = compared_with(outcome, plain)
    assert [error for error in outcome.posterior.calibration if error.supported] == [entry]
    assert not any(error.supported for error in alone.posterior.calibration)
    assert entry_of(alone, "gain", **where).contradicted_by
    assert not entry.contradicted_by
    assert outcome.result.bsp.total_mass_kg == pytest.approx(walking_subject().literature.total_mass_kg, rel=0.02)


def test_a_load_that_is_missing_late_in_stance_is_not_a_gain(trial):
    """As under a forefoot beyond the plate's edge: up to half of the load, from half of the stance on."""

    def beyond_edge(positions, loads):
        first, last = longest_load(loads[:, 0, 1])
        loads[first : last + 1, 0] *= 1.0 - np.clip(np.linspace(-1.0, 1.0, last + 1 - first), 0.0, 0.5)[:, None]

    (found,) = [finding for finding in of_estimate(fitted(trial, disturb=beyond_edge)) if finding.code == "P288"]
    assert (found.where.plate, found.where.trial) == ("right foot", "walk")
    assert found.evidence["missing"].value > 0.1


@pytest.mark.parametrize("axis", [0, 2])
def test_a_horizontal_zero_is_named_and_put_right(trial, plain, axis):
    """No place, gain or clock is to blame for it."""

    def push(positions, loads):
        force = np.zeros((len(loads), 3))
        force[loads[:, 1, 1] > 20.0, axis] = 8.0
        point = centre_of_pressure(loads[:, 1])
        loads[:, 1] += np.concatenate([force, np.cross(point, force)], axis=1)

    outcome = fitted(trial, disturb=push)
    entry = entry_of(outcome, "zero offset", plate="left foot", trial="walk", axis="xyz"[axis])
    assert entry.value == pytest.approx(8.0, abs=3.0 * entry.sd)
    assert entry.sd < 1.6
    (found,) = of_estimate(outcome)
    assert (found.code, found.where.trial, found.where.plate) == ("P215", "walk", "left foot")
    assert found.evidence["zero_offset_n"].value == entry.value
    expected, found = (fit.foot_loads[0][10:-10, 1, axis] for fit in (plain, outcome))
    assert np.abs(found.mean() - expected.mean()) < 2.0


def test_zeros_of_a_plate_that_two_trials_share_are_each_trial_s_own(trial):
    """An amplifier drifts from one to the next; the plate stays where it is."""
    kinematics = []
    for seed, zero_offset_n in enumerate((0.0, -8.0)):
        loads = trial.foot_loads.copy()
        force = np.where(loads[:, 1, 1:2] > 20.0, [zero_offset_n, 0.0, 0.0], 0.0)
        loads[:, 1] += np.concatenate([force, np.cross(centre_of_pressure(loads[:, 1]), force)], axis=1)
        kinematics.append(seen(trial, seed, loads=loads, name=f"walk {seed}"))
    outcome = estimated(trial, kinematics)
    zeros = [entry_of(outcome, "zero offset", plate="left foot", trial=f"walk {k}", axis="x") for k in range(2)]
    assert zeros[0].value == pytest.approx(0.0, abs=1.0)
    assert zeros[1].value == pytest.approx(-8.0, abs=3.0 * zeros[1].sd)
    assert abs(entry_of(outcome, "position", plate="left foot", axis="x").value) < 0.002


@pytest.mark.slow
@pytest.mark.parametrize(
    ("disturb", "where"),
    [
        (
            lambda loads: loads[:, 0, 3:].__iadd__(np.cross([0.0, 0.0, 0.02], loads[:, 0, :3])),
            {"quantity": "position", "plate": "right foot", "axis": "z"},
        ),
        (lambda loads: loads[:, 1].__imul__(1.05), {"quantity": "gain", "plate": "left foot", "trial": "walk"}),
        (lambda loads: loads.__setitem__(slice(None), np.roll(loads, 2, axis=0)), {"quantity": "delay"}),
    ],
    ids=["20 mm", "5 %", "20 ms"],
)
def test_instruments_that_are_really_off_are_accused(trial, disturb, where):
    """By a warning that says to check them, and by no other; sound ones are not even corrected."""
    outcome = fitted(trial, disturb=lambda positions, loads: disturb(loads))
    entry = entry_of(outcome, **where)
    assert entry.moved > 1.0
    supported = [error for error in outcome.posterior.calibration if error.supported]
    # of a single trial the delay is there as that of all trials, and as its total
    assert {(error.plate, error.quantity, error.axis) for error in supported} == {
        (entry.plate, entry.quantity, entry.axis)
    }
    assert sum(finding.causes == ("the instrument",) for finding in of_estimate(outcome)) == 1


def test_of_plates_along_the_way_one_is_accused_if_not_which(trial):
    """A short walk knows that one is off, not which: the error is shared out."""

    def shift(positions, loads):
        loads[:, 0, 3:] += np.cross([0.02, 0.0, 0.0], loads[:, 0, :3])

    (found,) = [finding for finding in of_estimate(fitted(trial, disturb=shift)) if finding.code == "P247"]
    assert found.where.axis == "fore-aft"
    assert 1e3 * found.evidence["difference_m"].value == pytest.approx(20.0, abs=4.5)  # as "16 mm" was before


def test_plates_that_may_be_off_together_along_the_walk_are_as_uncertain(trial):
    """A short walk does not show it, but three standard deviations reach as far."""

    def shift(positions, loads):
        loads[..., 3:] += np.cross([0.03, 0.0, 0.0], loads[..., :3])

    outcome = fitted(trial, disturb=shift)
    for plate in ("right foot", "left foot"):
        found = entry_of(outcome, "position", plate=plate, axis="x")
        assert 0.0 < found.value < 0.03 < found.value + 3.0 * found.sd


@pytest.mark.slow
def test_a_plate_that_is_off_in_one_trial_of_three_is_not_accused(trial):
    """It has not moved in the meantime: what one says and the others contradict is apparent."""

    def fit_of(*shifts_m):
        kinematics = []
        for seed, shift_m in enumerate(shifts_m, start=100):
            loads = trial.foot_loads.copy()
            loads[:, 0, 3:] += np.cross([0.0, 0.0, shift_m], loads[:, 0, :3])
            kinematics.append(seen(trial, seed, loads=loads, name=f"walk {seed}"))
        return entry_of(estimated(trial, kinematics), "position", plate="right foot", axis="z")

    together, apart = fit_of(0.03, 0.03, 0.03), fit_of(0.09, 0.0, 0.0)
    assert together.contradicted_by is None
    assert together.supported
    assert apart.contradicted_by == "another trial"
    assert not apart.supported


def test_a_free_moment_that_is_not_there_is_named(trial):
    """Nobody turns to the left all the time."""

    def crosstalk(positions, loads):
        loads[:, 1, 4] += 0.008 * loads[:, 1, 1]

    outcome = fitted(trial, disturb=crosstalk)
    entry = entry_of(outcome, "free moment", plate="left foot")
    assert entry.value == pytest.approx(0.008, abs=2.0 * PLATE_PRIOR["free moment"].sd)
    (found,) = [finding for finding in of_estimate(outcome) if finding.code == "P267"]
    assert found.where.plate == "left foot"
    assert found.evidence["error_nm_n"].value == entry.value


def test_plates_turned_against_the_cameras_are_named_and_put_right(trial, plain):
    """Both, about the places where they are loaded: their offsets are not to blame."""
    outcome = fitted(trial, disturb=turned(3.0, (0, 1)))
    entries = [entry_of(outcome, "rotation", plate=plate) for plate in ("right foot", "left foot")]
    for entry in entries:
        assert np.degrees(entry.value) == pytest.approx(3.0, abs=1.0)
        assert abs(entry.value - np.radians(3.0)) < 3.0 * entry.sd
    (found,) = of_estimate(outcome)
    assert (found.code, found.where.plate) == ("P234", None)
    assert found.evidence["rotation_rad"].value == max(
        error.value for error in entries
    )  # counter-clockwise seen from above
    sound = entry_of(plain, "rotation", plate="left foot")
    assert abs(sound.value) < sound.prior_sd


def test_one_turned_plate_is_named_and_the_other_is_not(trial):
    outcome = fitted(trial, disturb=turned(6.0, (1,)))
    entry = entry_of(outcome, "rotation", plate="left foot")
    assert np.degrees(entry.value) == pytest.approx(6.0, abs=1.5)
    (found,) = [finding for finding in of_estimate(outcome) if finding.code in ("P234", "P237")]
    assert (found.code, found.where.plate) == ("P237", "left foot")


def turned(angle_deg, feet):
    """Rotate the loads under these feet about the vertical through their mean centres of pressure."""

    def turn(positions, loads):
        back = Rotation.from_euler("y", angle_deg, degrees=True).as_matrix()
        for foot in feet:
            weight = loads[:, foot, 1]
            point = np.stack([loads[:, foot, 5], np.zeros_like(weight), -loads[:, foot, 3]], axis=1)
            middle = point.sum(axis=0) / weight.sum()
            about = loads[:, foot, 3:] - np.cross(middle, loads[:, foot, :3])
            loads[:, foot, :3] = loads[:, foot, :3] @ back.T
            loads[:, foot, 3:] = about @ back.T + np.cross(middle, loads[:, foot, :3])

    return turn
