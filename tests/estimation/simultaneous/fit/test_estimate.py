"""What `fit_simultaneous` finds of body and motion."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.walk import walking_subject
from results import entry_of, of_estimate
from short_walk_fit import estimated, fitted, seen
from validation.synthetic_walks import kinematics_of


def test_a_person_like_the_literature_has_no_finding(plain):
    assert of_estimate(plain) == []
    assert plain.result.converged
    assert plain.result.bsp.physically_consistent().all()


def test_information_is_between_nothing_and_everything(plain):
    posterior = plain.posterior
    assert posterior.information.shape == (12, 10)
    assert posterior.information.min() > -1e-6
    assert posterior.information.max() < 1.0
    np.testing.assert_allclose(posterior.sd, posterior.prior_sd * np.sqrt(1 - posterior.information))
    np.testing.assert_allclose(np.sqrt(np.diag(posterior.covariance)), posterior.sd.ravel())
    mass = dict(zip(plain.result.bsp.segments, posterior.information[:, 0], strict=True))
    assert mass["thigh_r"] > mass["forearm_r"]


def test_loads_and_motion_cover_the_window(trial, plain):
    (motion,), (loads,) = plain.motions, plain.foot_loads
    assert len(motion.q) == len(loads)
    assert loads.shape[1:] == (2, 6)
    window = trial.window.wrench[5 : 5 + len(loads)]
    np.testing.assert_allclose(loads.sum(axis=1)[10:-10], window[10:-10], atol=25.0)


@pytest.mark.slow
def test_intervals_are_used_together_and_forces_between_them_say_nothing(trial, plain):
    """Unmeasured from 0.3 to 0.6 s, where a plate loses a third of the weight: with and without."""
    loads = trial.foot_loads.copy()
    loads[(trial.time > 0.4) & (trial.time < 0.5)] *= 0.7
    windows = ((0.06, 0.3), (0.6, 0.84))
    outcomes = [
        estimated(trial, [replace(seen(trial, loads=foot_loads), windows_s=windows)])
        for foot_loads in (trial.foot_loads, loads)
    ]
    for outcome in outcomes:
        (motion,) = outcome.motions
        assert len(motion.q) == len(outcome.foot_loads[0]) == 50
        assert outcome.result.converged
        assert of_estimate(outcome) == []
        # the walker's products of inertia are zero, which the prior does not expect, and so short a walk does not show
        within = np.abs(outcome.bsp.table() - trial.bsp.table()) < 3.0 * outcome.posterior.sd
        assert within[:, :7].all()
    sound, lost = outcomes
    change = np.abs(sound.bsp.table() - lost.bsp.table()) / sound.posterior.sd
    assert change.max() < 0.3
    # two intervals show less than all, and more than nothing
    shown = np.nansum(sound.posterior.information)
    assert 0.2 * np.nansum(plain.posterior.information) < shown < np.nansum(plain.posterior.information)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [slice(40, 41), slice(40, 48), slice(2, 14)])
def test_the_motion_is_known_in_every_frame_of_the_window_though_the_pelvis_is_not_seen(trial, gap):
    pelvis = [trial.markers.labels.index(m.label) for m in trial.skeleton.markers if m.segment == "pelvis"]
    positions = camera_noise(trial.markers, 0.002, np.random.default_rng(0)).positions
    positions[gap, pelvis] = np.nan
    kinematics = kinematics_of(trial, replace(trial.markers, positions=positions), trial.foot_loads)
    outcome = estimated(trial, [kinematics])
    assert outcome.result.converged
    at = np.searchsorted(trial.time, kinematics.time - 1e-9)
    np.testing.assert_allclose(outcome.motions[0].q, trial.motion.q[at], atol=0.06)
    assert outcome.foot_loads[0].shape == (len(at), 2, 6)
    seen = outcome.result.curve_deviations[0].moments
    assert len(at) <= len(seen) <= len(kinematics.trajectory_time)
    assert np.isfinite(seen).all()


def test_a_wrong_axis_of_the_knee_is_found_where_axes_are_free(trial, plain):
    wrong = {"knee_tilt_1_r": 0.12, "knee_tilt_2_r": 0.08}
    off = replace(trial, skeleton=trial.skeleton.lock(wrong))
    noisy = camera_noise(trial.markers, 0.002, np.random.default_rng(0))
    kinematics = kinematics_of(off, noisy, trial.foot_loads)
    outcome = estimated(off, [kinematics], uncertainty=GAIT27_UNCERTAINTY.with_axes())
    for (_, put_in), axis in zip(wrong.items(), "12", strict=True):
        entry = entry_of(outcome, "axis change", joint="knee_r", axis=axis)
        assert entry.unit == "rad"
        assert entry.prior_sd == pytest.approx(np.radians(5.0))
        assert entry.sd < 0.7 * entry.prior_sd
        assert abs(entry.value + put_in) < 3.0 * entry.sd
    assert "axis change" not in {error.quantity for error in plain.posterior.calibration}


def test_a_model_that_is_contradicted_is_called_so(trial):
    literature = walking_subject().literature
    com = literature.com_m.copy()
    com[literature.segments.index("torso"), 0] += 0.15
    wrong = replace(literature, com_m=com)
    found = of_estimate(fitted(trial, wrong), literature=wrong)
    far = {finding.where.part: finding.evidence["distance_sd"].value for finding in found if finding.code == "R203"}
    assert far["fore-aft centre of mass of the torso"] < -3.0


def test_an_unfinished_estimate_is_called_so(trial, monkeypatch):
    monkeypatch.setattr("kinertia.estimation.simultaneous.solver._MAX_ITERATIONS", 1)
    (found,) = [finding for finding in of_estimate(fitted(trial)) if finding.code == "R201"]
    assert found.evidence["iterations"].value == 1
