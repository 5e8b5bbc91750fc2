"""What `fit_simultaneous` finds of markers."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY
from kinertia.synthetic.laboratory import camera_noise
from kinertia.synthetic.walk import walk, walking_subject
from results import codes, of_estimate
from short_walk_fit import estimated, fitted, seen
from validation.synthetic_walks import kinematics_of


@pytest.mark.slow
def test_a_drifting_marker_is_named(trial):
    def wander(positions, loads):
        at = trial.markers.labels.index("R.Bicep")
        positions[:, at] += np.random.default_rng(1).normal(0.0, 0.05, positions[:, at].shape)

    drifting = [finding for finding in of_estimate(fitted(trial, disturb=wander)) if finding.code == "M163"]
    (found,) = [finding for finding in drifting if finding.where.markers == ("R.Bicep",)]
    assert found.where.trial == "walk"
    assert found.evidence["sd_m"].value > 3.0 * found.evidence["usual_sd_m"].value


@pytest.mark.slow
def test_a_marker_attached_anew_between_trials_is_named(trial):
    at = trial.markers.labels.index("R.Thigh.Front")
    turned = trial.skeleton.pose(trial.motion.q).rotation[:, trial.skeleton.marker_segments[at]]
    positions = [camera_noise(trial.markers, 0.002, np.random.default_rng(seed)).positions for seed in (0, 1)]
    positions[1][:, at] += turned @ [0.0, -0.05, 0.0]
    kinematics = [
        kinematics_of(trial, replace(trial.markers, positions=position), trial.foot_loads) for position in positions
    ]
    outcome = estimated(trial, kinematics)
    found = of_estimate(outcome, "one", "two")
    assert codes(found) == ["M162", "M162"]  # of two trials, either may be the odd one
    assert [finding.where.trial for finding in found] == ["one", "two"]
    assert {finding.where.markers for finding in found} == {("R.Thigh.Front",)}
    assert found[0].evidence["difference_m"].value == pytest.approx(0.05, abs=0.01)
    places = [skeleton.markers[skeleton.labels.index("R.Thigh.Front")].position[1] for skeleton in outcome.skeletons]
    assert places[1] - places[0] == pytest.approx(-0.05, abs=0.01)


@pytest.mark.slow
def test_markers_that_stay_do_so_in_every_trial(trial):
    """Else a second trial would make a model with wrong marker places look right."""
    rng = np.random.default_rng(0)
    places = trial.skeleton.marker_locals + rng.normal(0.0, 0.012, trial.skeleton.marker_locals.shape)
    wrong = replace(trial, skeleton=trial.skeleton.with_positions(places))
    markers = [camera_noise(trial.markers, sd_m, rng) for sd_m in (0.001, 0.002)]
    kinematics = [kinematics_of(wrong, marker, trial.foot_loads) for marker in markers]
    outcome = estimated(wrong, kinematics, uncertainty=replace(GAIT27_UNCERTAINTY, marker_sd_m=None))
    for skeleton in (outcome.skeleton, *outcome.skeletons):
        np.testing.assert_array_equal(skeleton.marker_locals, wrong.skeleton.marker_locals)
    # and the body need not make up for them
    assert outcome.result.converged
    assert "R203" not in codes(of_estimate(outcome, "one", "two"))
    literature = walking_subject().literature
    away = (outcome.bsp.table() - literature.table()) / literature_prior(literature).sd
    assert np.abs(away).max() < 2.0


def test_angles_and_moments_about_fixed_axes_are_less_certain():
    trial = walk(walking_subject(), 0.8, 100.0)
    kinematics = [seen(trial)]
    moved = replace(GAIT27_UNCERTAINTY, moved_m={"torso": 0.03}).with_fixed_axes()
    fits = [estimated(trial, kinematics, uncertainty=uncertainty) for uncertainty in (GAIT27_UNCERTAINTY, moved)]
    before, after = (fit.deviations[0] for fit in fits)
    growth = dict(
        zip(trial.skeleton.coordinates, np.nanmedian(after.coordinates / before.coordinates, axis=0), strict=True)
    )
    assert growth["lumbar_rotation"] > 1.15
    assert growth["hip_rotation_r"] > 1.1
    assert growth["pelvis_tx"] == 1.0
    about = np.array([name.startswith(("knee", "ankle", "subtalar")) for name in trial.skeleton.coordinates])
    for kind in ("moments", "powers"):
        changed, same = getattr(after, kind), getattr(before, kind)
        np.testing.assert_array_equal(changed[:, ~about], same[:, ~about])
        assert (changed[:, about] > same[:, about]).mean() > 0.95
    np.testing.assert_array_equal(after.joints, before.joints)
    of_instruments = [[entry.moved for entry in fit.posterior.calibration if entry.of_instrument] for fit in fits]
    assert np.max(of_instruments[0]) > 0.0
    np.testing.assert_allclose(*of_instruments, rtol=1e-9)


def test_markers_are_off_by_what_exceeds_their_prior():
    moved = replace(GAIT27_UNCERTAINTY, moved_m={"torso": 0.03, "thigh_r": 0.0065, "pelvis": 0.004})
    off_m = [moved.misplaced_m(segment) for segment in ("torso", "thigh_r", "pelvis", "foot_r")]
    np.testing.assert_allclose(off_m, [np.sqrt(75e-6), np.sqrt(17.25e-6), 0.0, 0.0])
