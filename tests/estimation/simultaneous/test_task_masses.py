import numpy as np

from kinertia.estimation.simultaneous.task_masses import TASK_SD, across_tasks, task_direction

SEGMENTS = ("pelvis", "femur_r", "femur_l", "torso")
MASS_KG = np.array([10.0, 8.0, 8.0, 20.0])


def test_what_thighs_lose_the_pelvis_gains():
    direction = task_direction(SEGMENTS, MASS_KG)
    masses = direction[::10] * MASS_KG
    np.testing.assert_allclose(masses, [-16.0 * TASK_SD, 8.0 * TASK_SD, 8.0 * TASK_SD, 0.0])
    assert not direction[np.arange(40) % 10 != 0].any()


def test_without_a_pelvis_thighs_alone():
    assert task_direction(("femur_r",), np.array([8.0]))[0] == TASK_SD


def test_it_is_one_more_unknown_of_the_estimate():
    """Against the whole problem: data on x + z t, priors on x and z."""
    rng = np.random.default_rng(104)
    root, prior, t = rng.normal(size=(6, 4)), np.diag([1.0, 4.0, 2.0, 0.5]), rng.normal(size=4)
    measured, data = rng.normal(size=6), root.T @ root
    covariance = np.linalg.inv(prior + data)
    estimate = covariance @ root.T @ measured
    moved, added = across_tasks(t, data @ t, float(t @ prior @ estimate), covariance)

    rows = np.hstack([root, (root @ t)[:, None]])
    whole = np.linalg.inv(rows.T @ rows + np.block([[prior, np.zeros((4, 1))], [np.zeros((1, 4)), np.ones((1, 1))]]))
    np.testing.assert_allclose(estimate + moved, (whole @ rows.T @ measured)[:4], atol=1e-12)
    np.testing.assert_allclose(covariance + added, whole[:4, :4], atol=1e-12)
