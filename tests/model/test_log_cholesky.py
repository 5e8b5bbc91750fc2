import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from generic_static import generic_model
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.log_cholesky import (
    dynamic_jacobian,
    from_log_cholesky,
    nearest_consistent,
    table_jacobian,
    to_log_cholesky,
)

SEGMENTS = ("pelvis", "thigh_r")


@pytest.fixture(scope="module")
def literature():
    return literature_bsp(70.0, 1.75, "male", generic_model().geometry)


def random_theta(seed: int = 0, segments: int = 2) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.5, 10 * segments)


def differences(function, theta: np.ndarray) -> np.ndarray:
    """(len(function), len(theta)) central differences."""
    h = 1e-6
    return np.stack([(function(theta + s) - function(theta - s)) / (2 * h) for s in h * np.eye(len(theta))], axis=-1)


def test_round_trip(literature):
    again = from_log_cholesky(literature.segments, to_log_cholesky(literature))
    np.testing.assert_allclose(again.table(), literature.table(), rtol=1e-12, atol=1e-14)
    theta = random_theta()
    np.testing.assert_allclose(to_log_cholesky(from_log_cholesky(SEGMENTS, theta)), theta, atol=1e-12)


def test_an_impossible_body_has_no_parameters():
    impossible = BodySegmentParameters(("a",), [1.0], [[0.0, 0.0, 0.0]], [np.diag([1.0, 1.0, 3.0])])
    with pytest.raises(np.linalg.LinAlgError):
        to_log_cholesky(impossible)


@pytest.mark.parametrize("seed", range(3))
def test_table_jacobian_agrees_with_finite_differences(seed):
    theta = random_theta(seed)
    numeric = differences(lambda x: from_log_cholesky(SEGMENTS, x).table().ravel(), theta)
    analytic = table_jacobian(theta)
    for i in range(2):
        block = slice(10 * i, 10 * i + 10)
        np.testing.assert_allclose(analytic[i], numeric[block, block], atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_dynamic_jacobian_agrees_with_finite_differences(seed):
    theta = random_theta(seed)
    numeric = differences(lambda x: from_log_cholesky(SEGMENTS, x).dynamic_parameters(), theta)
    analytic = dynamic_jacobian(theta)
    for i in range(2):
        block = slice(10 * i, 10 * i + 10)
        np.testing.assert_allclose(analytic[i], numeric[block, block], atol=1e-8)


@given(arrays(float, 20, elements=st.floats(-4.0, 4.0)))
def test_any_parameters_are_a_physically_consistent_body(theta):
    assert from_log_cholesky(SEGMENTS, theta).physically_consistent().all()


def test_a_consistent_body_is_its_own_nearest(literature):
    np.testing.assert_allclose(nearest_consistent(literature).table(), literature.table(), atol=1e-14)


def test_nearest_consistent_changes_only_what_is_impossible():
    tensors = [np.diag([1.0, 1.2, 1.5]), np.diag([1.0, 1.0, 2.5])]
    bsp = BodySegmentParameters(SEGMENTS, [2.0, 3.0], np.ones((2, 3)), tensors)
    raised = nearest_consistent(bsp)
    assert list(bsp.physically_consistent()) == [True, False]
    assert raised.physically_consistent().all()
    np.testing.assert_allclose(raised.table()[0], bsp.table()[0], atol=1e-15)
    np.testing.assert_array_equal(raised.table()[1, :4], bsp.table()[1, :4])
    assert raised.inertia_kgm2[1, 2, 2] < raised.inertia_kgm2[1, 0, 0] + raised.inertia_kgm2[1, 1, 1]
