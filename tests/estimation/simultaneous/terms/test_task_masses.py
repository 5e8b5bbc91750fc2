import numpy as np
import pytest

from kinertia.estimation.simultaneous.terms.task_masses import hips_bent_rad, task_direction
from kinertia.synthetic.walk import walking_subject

SEGMENTS = ("pelvis", "femur_r", "femur_l", "torso")
MASS_KG = np.array([10.0, 8.0, 8.0, 20.0])


def test_what_thighs_lose_the_pelvis_gains():
    direction = task_direction(SEGMENTS, MASS_KG, 0.1)
    masses = direction[::10] * MASS_KG
    np.testing.assert_allclose(masses, [-1.6, 0.8, 0.8, 0.0])
    assert not direction[np.arange(40) % 10 != 0].any()


def test_without_a_pelvis_thighs_alone():
    assert task_direction(("femur_r",), np.array([8.0]), 0.2)[0] == 0.2


@pytest.mark.parametrize("turned", [0.0, 0.4, -1.9])
def test_hips_are_bent_as_far_as_a_thigh_turns(turned):
    skeleton = walking_subject().skeleton
    q = np.zeros((40, len(skeleton.coordinates)))
    q[:, 3] = 0.7  # the whole person
    q[10:, list(skeleton.coordinates).index("hip_flexion_l")] = turned
    assert hips_bent_rad(skeleton, q) == pytest.approx(abs(turned), abs=1e-6)
