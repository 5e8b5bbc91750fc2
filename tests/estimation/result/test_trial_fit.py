"""Joint loads of fits, wherever they are known."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.result.drawn_fit import drawn_fit, kept_draws
from kinertia.estimation.result.trial_fit import known_with_forces
from kinertia.estimation.simultaneous.uncertainty.model_errors import CENTRE_SD_M
from kinertia.io.text.sto import read_sto
from kinertia.motion.joint_moments import body_joints
from kinertia.report.exports.saved_fit import load_fit
from recordings import FITTED

WALKS = sorted(name for name in FITTED if name in ("synthetic", "pig_a"))


@pytest.fixture(scope="module", params=WALKS)
def result(request, fit_of):
    folder = fit_of(request.param).folder
    return folder, load_fit(folder).trials[0]


def test_they_are_those_of_the_measured_windows_there(result):
    _, trial = result
    curves, inner = trial.joint_curves, trial.kinematics.frames - trial.kinematics.trajectory_frames.start
    np.testing.assert_allclose(curves.time[inner], trial.time)
    for stage in ("literature", "estimate"):
        np.testing.assert_allclose(curves.forces[stage][inner], trial.joint_loads[stage], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(curves.deviations.moments[inner], trial.deviations.moments)
    assert np.isfinite(curves.joints["estimate"].moments[inner]).all()
    assert np.isfinite(curves.moment_sd[inner]).all()


def test_a_number_has_an_error_bar_and_what_is_not_known_has_none(result):
    _, trial = result
    curves = trial.joint_curves
    np.testing.assert_array_equal(np.isfinite(curves.forces["estimate"]), curves.known)
    np.testing.assert_array_equal(np.isfinite(curves.deviations.moments), curves.known)
    found = np.isfinite(curves.joints["estimate"].moments)
    np.testing.assert_array_equal(np.isfinite(curves.moment_sd), found)
    np.testing.assert_array_equal(np.isfinite(curves.force_sd), found)
    assert (curves.moment_sd[found] > 0.0).all()
    # a leg is known longer than both together are
    knees = [found[:, curves.joints["estimate"].joints.index(f"knee_{side}"), 0] for side in "rl"]
    assert min(knee.sum() for knee in knees) > 1.1 * len(trial.time)
    legs = trial.kinematics.trial.known_legs[trial.kinematics.trajectory_frames]
    for foot, knee in enumerate(knees):
        assert not knee[~legs[:, foot]].any()


def test_error_bars_of_hips_are_those_of_their_generalised_forces(result):
    """But for rotation, which depends on where the knee is."""
    _, trial = result
    curves, every = trial.joint_curves, body_joints(trial.skeleton)
    joints, names = curves.joints["estimate"].joints, trial.skeleton.coordinates
    pose = trial.skeleton.pose(np.zeros((1, len(names))))
    for side in "rl":
        hip, knee = (joints.index(f"{name}_{side}") for name in ("hip", "knee"))
        thigh_m = np.linalg.norm(np.diff([every[k].centre(trial.skeleton, pose)[0] for k in (hip, knee)], axis=0))
        for axis, name in enumerate(("flexion", "adduction", "rotation")):
            expected = curves.deviations.moments[:, names.index(f"hip_{name}_{side}")]
            found = curves.moment_sd[:, hip, axis]
            if name == "rotation":
                known = np.isfinite(found)
                assert (found[known] >= 0.999 * expected[known]).all()
                flexion = curves.joints["estimate"].moments[known, hip, 0]
                added = np.mean(np.square(found[known]) - np.square(expected[known]))
                # forces are averaged over their uncertain delay there
                assert np.sqrt(added) == pytest.approx(CENTRE_SD_M / thigh_m * np.sqrt(np.mean(flexion**2)), rel=0.02)
            else:
                np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_files_have_every_joint_and_nan_where_it_is_not_known(result):
    folder, trial = result
    curves = trial.joint_curves
    moments, sd = read_sto(folder / "joint_moments.sto"), read_sto(folder / "joint_moments_sd.sto")
    assert tuple(moments.columns) == tuple(sd.columns) == curves.joints["estimate"].names
    rows = np.isin(np.round(curves.time, 6), np.round(moments.index, 6))
    expected = curves.joints["estimate"].moments[rows].reshape(len(moments), -1)
    np.testing.assert_allclose(moments.to_numpy(), expected, rtol=1e-12)
    np.testing.assert_array_equal(np.isnan(sd.to_numpy()), np.isnan(expected))
    forces = read_sto(folder / "inverse_dynamics.sto")
    kept = np.isfinite(forces["knee_angle_r_moment"]).to_numpy()
    np.testing.assert_array_equal(forces.index[kept], moments.index[np.isfinite(moments["knee_r_flexion"])])
    assert len(read_sto(folder / "residuals.sto")) == len(trial.time)


@pytest.mark.parametrize("walk", WALKS[-1:])
def test_draws_spread_as_the_error_bars_say(fit_of, walk):
    """Also what a hinge transmits, in which the knee's geometry is drawn, too."""
    fit = load_fit(fit_of(walk).folder)
    (trial,), count = fit.trials, kept_draws(fit).count
    drawn = np.array([drawn_fit(fit, n).trials[0].joint_curves.joints["estimate"].moments for n in range(count)])
    apart = np.nanmean(np.square(drawn - trial.joint_curves.joints["estimate"].moments), axis=(0, 1))
    reported = np.nanmean(np.square(trial.joint_curves.moment_sd), axis=0)
    ratio = np.sqrt(apart / reported)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1 + 1.0 / np.sqrt(2.0 * count))
    np.testing.assert_allclose(ratio, 1.0, atol=0.3)


def test_legs_are_known_as_far_as_forces_reach(result):
    """Forces that are found to be late end before the markers do; trunk and arms need none, and windows stay."""
    _, trial = result
    k, names = trial.kinematics, trial.skeleton.coordinates
    time, before, inside = k.trajectory_time, k.trajectory_known, k.inside(k.trajectory_time)
    of_leg = np.array([name.startswith(("hip", "knee", "ankle", "subtalar", "pelvis")) for name in names])
    legs = before[:, of_leg].any(axis=1) & ~inside
    last_s = time[np.flatnonzero(legs)[-1]]
    for late_s, reaches in ((0.0049, True), (0.0051, False)):
        forces = replace(trial.reactions, time=np.array([time[0], last_s - late_s]))
        known = known_with_forces(trial.skeleton, k, forces)
        expected = before & (~of_leg | inside[:, None] | (time <= last_s - (0.0 if reaches else 1e-6))[:, None])
        np.testing.assert_array_equal(known, expected)
        assert (known != before).any() != reaches
