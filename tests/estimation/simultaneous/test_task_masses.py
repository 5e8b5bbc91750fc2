import numpy as np

from kinertia.estimation.simultaneous.task_masses import TASK_SD, task_direction

SEGMENTS = ("pelvis", "femur_r", "femur_l", "torso")
MASS_KG = np.array([10.0, 8.0, 8.0, 20.0])


def test_what_thighs_lose_the_pelvis_gains():
    direction = task_direction(SEGMENTS, MASS_KG)
    masses = direction[::10] * MASS_KG
    np.testing.assert_allclose(masses, [-16.0 * TASK_SD, 8.0 * TASK_SD, 8.0 * TASK_SD, 0.0])
    assert not direction[np.arange(40) % 10 != 0].any()


def test_without_a_pelvis_thighs_alone():
    assert task_direction(("femur_r",), np.array([8.0]))[0] == TASK_SD
