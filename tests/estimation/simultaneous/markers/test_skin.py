from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.markers.marker_noise import WithoutSkin
from kinertia.estimation.simultaneous.markers.skin import (
    ALIKE,
    CLAVICLE_M,
    CLAVICLE_PER_ARM,
    EXPECTED_SD_M,
    MOST_PATTERNS,
    OTHER_EXPECTED_SD_M,
    SkinPatterns,
    girdle_variance,
    skin_patterns,
)
from kinertia.estimation.simultaneous.observation import observe
from kinertia.model.skeleton import Joint
from kinertia.synthetic.laboratory import SkinMotion, camera_noise
from kinertia.synthetic.walk import walking_subject
from validation.synthetic_walks import kinematics_of, study_walk

MASS_KG = 72.6


@pytest.fixture(scope="module")
def trial():
    return study_walk(1.2)


@pytest.fixture(scope="module")
def patterns(trial):
    (of_trial,) = skin_patterns(trial.skeleton, [trial.motion.q])
    return of_trial


def drawn(patterns: SkinPatterns, rng: np.random.Generator) -> np.ndarray:
    """Coefficients from their prior."""
    return np.linalg.solve(np.linalg.cholesky(patterns.information()).T, rng.standard_normal(patterns.size))


@pytest.mark.slow
def test_the_prior_displaces_markers_by_what_is_expected(trial, patterns):
    rng = np.random.default_rng(0)
    moved = np.array([patterns.displaced(drawn(patterns, rng)) for _ in range(300)])
    sd = np.sqrt(np.square(moved).mean(axis=(0, 1, 3)))
    for segment, value in zip(trial.skeleton.marker_segments, sd, strict=True):
        kind = trial.skeleton.segments[segment].rpartition("_")[0]
        assert value == pytest.approx(EXPECTED_SD_M.get(kind, OTHER_EXPECTED_SD_M), rel=0.15)


def test_coefficients_of_a_segment_are_alike(trial, patterns):
    covariance = np.linalg.inv(patterns.information())
    assert np.diag(covariance) == pytest.approx(np.ones(patterns.size))
    thigh = np.flatnonzero(trial.skeleton.marker_segments == trial.skeleton.segments.index("thigh_r"))
    first, other = (patterns.begin[marker] for marker in thigh[:2])
    assert covariance[first, other] == pytest.approx(ALIKE)
    assert covariance[first, other + 1] == pytest.approx(0.0, abs=1e-12)
    elsewhere = np.flatnonzero(trial.skeleton.marker_segments == trial.skeleton.segments.index("shank_r"))[0]
    assert covariance[first, patterns.begin[elsewhere]] == pytest.approx(0.0, abs=1e-12)


def test_few_patterns_per_segment_and_none_of_the_whole_body(trial, patterns):
    assert (patterns.last - patterns.first).max() == MOST_PATTERNS
    turned = trial.motion.q.copy()
    turned[:, :6] += 0.3
    (of_turned,) = skin_patterns(trial.skeleton, [turned])
    np.testing.assert_allclose(of_turned.values, patterns.values, atol=1e-12)


def test_trials_share_their_patterns(trial):
    first, second = skin_patterns(trial.skeleton, [trial.motion.q[:60], trial.motion.q[60:]])
    (both,) = skin_patterns(trial.skeleton, [trial.motion.q])
    np.testing.assert_allclose(np.vstack([first.values, second.values]), both.values)
    assert first.first.tolist() == second.first.tolist() == both.first.tolist()


def test_skin_is_at_rest_where_the_markers_were_adapted(trial):
    adapted, other = skin_patterns(trial.skeleton, [trial.motion.q[:40], trial.motion.q[60:100]], [True, False])
    np.testing.assert_allclose(adapted.values.mean(axis=0), 0.0, atol=1e-12)
    assert np.abs(other.values.mean(axis=0)).max() > 1e-3


def test_a_motionless_trial_has_no_patterns(trial):
    (of_still,) = skin_patterns(trial.skeleton, [np.tile(trial.motion.q[:1], (20, 1))])
    assert of_still.size == 0
    assert not of_still.displaced(np.zeros(0)).any()
    assert of_still.information().shape == (0, 0)


def test_regression_takes_what_goes_with_the_joints_and_leaves_the_rest(trial, patterns):
    rng = np.random.default_rng(1)
    skin, noise = patterns.displaced(drawn(patterns, rng)), rng.normal(0.0, 0.001, trial.markers.positions.shape)
    errors = skin + noise
    errors[10:20, 3] = np.nan
    middle = np.nanmean(errors, axis=0)
    errors -= middle
    rest = WithoutSkin.of([errors], middle[None], [patterns], [1.0])
    assert np.isnan(rest.varying[0][10:20, 3]).all()
    assert np.nanstd(rest.varying[0]) == pytest.approx(0.001, rel=0.1)
    # where a marker was seen in all frames its patterns are zero on average: what is left of the place is the place
    np.testing.assert_allclose(np.delete(rest.displaced[0], 3, axis=0), np.delete(middle, 3, axis=0), atol=1e-9)


def test_another_posture_is_no_displacement(trial):
    """Skin that goes with the joints carries markers along in a trial of another posture: they were not moved."""
    q = [trial.motion.q[:40], trial.motion.q[60:100]]
    skin = skin_patterns(trial.skeleton, q)
    coefficients = drawn(skin[0], np.random.default_rng(2))
    moved = [pattern.displaced(coefficients) for pattern in skin]
    places = np.array([displaced.mean(axis=0) for displaced in moved])
    rest = WithoutSkin.of([displaced - displaced.mean(axis=0) for displaced in moved], places, skin, [1.0, 1.0])
    before, after = (np.abs(means[0] - means[1]).max() for means in (places, rest.displaced))
    assert after < 0.25 * before


def test_noise_is_what_skin_leaves(trial):
    """Skin that goes with the joints is mostly explained; deviations fall, but not to the cameras'."""
    rng = np.random.default_rng(0)
    skin = SkinMotion.draw(trial.skeleton, trial.motion.q, rng)
    moved = camera_noise(skin.moved(trial.markers, trial.skeleton, trial.motion.q), 0.0005, rng)
    seen = observe(trial.skeleton, [kinematics_of(trial, moved)], MASS_KG, [Bandwidth(10.0)])
    size = np.sqrt(np.square(moved.positions - trial.markers.positions).mean())
    assert 0.0005 < np.median(list(seen.noise[0].sd_m.values())) < 0.6 * size
    assert seen.separate[0].skin is not None
    assert np.isfinite(seen.separate[0].skin.values).all()


SWING = np.radians([-20.0, 20.0] * 50)
"""Cosine of 20 degrees is 0.94: forwards the arm goes by sine 20 degrees, up and down not at all."""


@pytest.fixture(scope="module")
def skeleton():
    return walking_subject().skeleton


def swung(skeleton, name: str) -> np.ndarray:
    q = np.zeros((len(SWING), len(skeleton.coordinates)))
    q[:, skeleton.coordinates.index(name)] = SWING
    return q


def markers_of_arm(skeleton, side: str) -> np.ndarray:
    return np.array([m.segment in (f"upper_arm{side}", f"forearm{side}") for m in skeleton.markers])


def test_the_girdle_carries_all_markers_of_the_arm_that_swings(skeleton):
    every = np.ones(len(skeleton.markers), dtype=bool)
    variance = girdle_variance(skeleton, swung(skeleton, "arm_flex_r"), every)
    expected = np.square(CLAVICLE_M * CLAVICLE_PER_ARM * np.sin(np.radians(20.0))) / 3.0
    rhs = markers_of_arm(skeleton, "_r")
    assert variance[rhs] == pytest.approx(rhs.sum() * expected, rel=0.02)
    assert not variance[~rhs].any()


def test_markers_that_the_trial_lacks_do_not_count(skeleton):
    q, every = swung(skeleton, "arm_flex_r"), np.ones(len(skeleton.markers), dtype=bool)
    fewer = every.copy()
    fewer[np.flatnonzero(markers_of_arm(skeleton, "_r"))[0]] = False
    rhs = markers_of_arm(skeleton, "_r") & fewer
    ratio = girdle_variance(skeleton, q, fewer)[rhs] / girdle_variance(skeleton, q, every)[rhs]
    assert ratio == pytest.approx((rhs.sum()) / (rhs.sum() + 1.0))


@pytest.mark.parametrize("name", ["elbow_flex_r", "pelvis_tilt", "lumbar_extension"])
def test_it_moves_neither_with_the_elbow_nor_with_the_trunk(skeleton, name):
    every = np.ones(len(skeleton.markers), dtype=bool)
    assert girdle_variance(skeleton, swung(skeleton, name), every) == pytest.approx(0.0, abs=1e-20)


def test_a_model_with_a_scapula_that_moves_has_its_own_girdle(skeleton):
    at = next(i for i, joint in enumerate(skeleton.joints) if joint.child == "upper_arm_r")
    shoulder = skeleton.joints[at]
    gliding = replace(shoulder.axes[-1], coordinate="scapula_elevation_r")
    scapula = Joint("torso", "scapula_r", shoulder.rotation, shoulder.translation, (gliding,))
    arm = replace(shoulder, parent="scapula_r", rotation=np.eye(3), translation=np.zeros(3))
    other = replace(skeleton, joints=(*skeleton.joints[:at], scapula, arm, *skeleton.joints[at + 1 :]))
    every = np.ones(len(other.markers), dtype=bool)
    assert not girdle_variance(other, swung(other, "arm_flex_r"), every).any()
    held = other.lock({"scapula_elevation_r": 0.0})
    assert girdle_variance(held, swung(held, "arm_flex_r"), every)[markers_of_arm(held, "_r")].all()
