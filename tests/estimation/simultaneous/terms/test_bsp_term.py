import numpy as np
import pytest

from kinertia.estimation.simultaneous.terms import bsp_term
from kinertia.estimation.simultaneous.terms.bsp_term import hips_bent_rad, task_direction
from kinertia.synthetic.walk import walk, walking_subject
from short_walk_fit import fitted

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


def test_moments_of_hips_are_less_certain_by_it(monkeypatch):
    trial = walk(walking_subject(), 0.9, trapezoid=False)
    monkeypatch.setattr(bsp_term, "TASK_SD_PER_RAD", 0.0)
    names, sd = list(trial.skeleton.coordinates), []
    for share in (0.0, 0.3):
        monkeypatch.setattr(bsp_term, "LEAST_TASK_SD", share)
        sd.append(np.sqrt(np.square(fitted(trial).result.curve_deviations[0].moments).mean(axis=0)))
    longer = dict(zip(names, sd[1] / sd[0], strict=True))
    assert longer["hip_flexion_r"] > 1.01
    assert longer["pelvis_tx"] > 1.05
    assert longer["ankle_angle_r"] == pytest.approx(1.0, abs=0.002)
