from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.markers.shoulder_girdle import CLAVICLE_M, CLAVICLE_PER_ARM, girdle_variance
from kinertia.model.skeleton import Joint
from kinertia.synthetic.walk import walking_subject

SWING = np.radians([-20.0, 20.0] * 50)
"""Cosine of 20 degrees is 0.94: forwards the arm goes by sine 20 degrees, up and down not at all."""


@pytest.fixture(scope="module")
def skeleton():
    return walking_subject().skeleton


def swung(skeleton, name: str) -> np.ndarray:
    q = np.zeros((len(SWING), len(skeleton.coordinates)))
    q[:, skeleton.coordinates.index(name)] = SWING
    return q


def of(skeleton, side: str) -> np.ndarray:
    return np.array([m.segment in (f"upper_arm{side}", f"forearm{side}") for m in skeleton.markers])


def test_the_girdle_carries_all_markers_of_the_arm_that_swings(skeleton):
    every = np.ones(len(skeleton.markers), dtype=bool)
    variance = girdle_variance(skeleton, swung(skeleton, "arm_flex_r"), every)
    expected = np.square(CLAVICLE_M * CLAVICLE_PER_ARM * np.sin(np.radians(20.0))) / 3.0
    rhs = of(skeleton, "_r")
    assert variance[rhs] == pytest.approx(rhs.sum() * expected, rel=0.02)
    assert not variance[~rhs].any()


def test_markers_that_the_trial_lacks_do_not_count(skeleton):
    q, every = swung(skeleton, "arm_flex_r"), np.ones(len(skeleton.markers), dtype=bool)
    fewer = every.copy()
    fewer[np.flatnonzero(of(skeleton, "_r"))[0]] = False
    rhs = of(skeleton, "_r") & fewer
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
    assert girdle_variance(held, swung(held, "arm_flex_r"), every)[of(held, "_r")].all()
