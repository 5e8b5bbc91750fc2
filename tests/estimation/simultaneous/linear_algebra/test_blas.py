"""Factors, solutions and products in place, against NumPy."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra import blas


@pytest.fixture(params=[(np.float64, 1e-12), (np.float32, 1e-4)], ids=["double", "single"])
def given(request):
    """A symmetric positive definite matrix, its factor, two other matrices, and how exact they are."""
    dtype, exact = request.param
    rng = np.random.default_rng(103)
    root = rng.normal(size=(5, 5)) + 5.0 * np.eye(5)
    matrix = root @ root.T
    parts = (matrix, np.linalg.cholesky(matrix), rng.normal(size=(5, 3)), rng.normal(size=(4, 5)))
    return *(part.astype(dtype) for part in parts), exact


def test_the_factor_is_the_lower_one_and_zero_above(given):
    matrix, lower, *_, exact = given
    blas.cholesky(matrix)
    np.testing.assert_allclose(matrix, lower, atol=exact * 100)
    assert not np.triu(matrix, 1).any()


def test_what_is_not_positive_definite_raises(given):
    matrix = given[0]
    matrix[2, 2] = -1.0
    with pytest.raises(np.linalg.LinAlgError):
        blas.cholesky(matrix)


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions(given, transposed):
    _, lower, rhs, left, exact = given
    solution = rhs.copy()
    blas.solve_lower(lower, solution, transposed)
    np.testing.assert_allclose((lower.T if transposed else lower) @ solution, rhs, atol=10 * exact)
    across = left.copy()
    blas.solve_lower_from_right(lower, across)
    np.testing.assert_allclose(across @ lower.T, left, atol=10 * exact)


def test_squares_and_products_are_taken_off(given):
    matrix, lower, rhs, left, exact = given
    target = matrix.copy()
    blas.subtract_square(target, rhs)
    np.testing.assert_allclose(np.tril(target), np.tril(matrix - rhs @ rhs.T), atol=100 * exact)
    target = np.zeros((4, 3), rhs.dtype)
    blas.subtract_product(target, left, rhs)
    np.testing.assert_allclose(target, -left @ rhs, atol=10 * exact)
    target = np.zeros((5, 3), rhs.dtype)
    blas.subtract_product(target, lower, rhs, transposed=True)
    np.testing.assert_allclose(target, -lower.T @ rhs, atol=100 * exact)
