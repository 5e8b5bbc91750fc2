import numpy as np

from kinertia.estimation.simultaneous.task_masses import TASK_SD, task_covariance

SEGMENTS = ("pelvis", "femur_r", "femur_l", "torso")
MASS_KG = np.array([10.0, 8.0, 8.0, 20.0])


def test_what_thighs_lose_the_pelvis_gains():
    of_masses = task_covariance(SEGMENTS, MASS_KG)[::10, ::10] * np.outer(MASS_KG, MASS_KG)
    np.testing.assert_allclose(np.sqrt(np.diag(of_masses)), [16.0 * TASK_SD, 8.0 * TASK_SD, 8.0 * TASK_SD, 0.0])
    np.testing.assert_allclose(of_masses.sum(), 0.0, atol=1e-12)


def test_nothing_but_masses_changes():
    covariance = task_covariance(SEGMENTS, MASS_KG)
    kept = np.arange(40) % 10 != 0
    assert not covariance[kept].any()
    assert not covariance[:, kept].any()


def test_without_a_pelvis_thighs_alone():
    assert task_covariance(("femur_r",), np.array([8.0]))[0, 0] == TASK_SD**2
