import numpy as np
import pytest

from block_systems import random_system
from kinertia.estimation.simultaneous.linear_algebra import block_tridiagonal
from kinertia.estimation.simultaneous.linear_algebra.block_tridiagonal import BlockBand


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize(("blocks", "size"), [(1, 3), (2, 1), (6, 4)])
def test_factor_and_solutions_agree_with_dense_cholesky(blocks, size, columns):
    dense, diagonal, below = random_system(blocks, size)
    lower = np.linalg.cholesky(dense)
    rhs = np.random.default_rng(1).normal(size=(blocks * size, columns))
    band = BlockBand.factor(diagonal, below)
    forward = band.forward(rhs.reshape(blocks, size, columns))
    np.testing.assert_allclose(forward.reshape(-1, columns), np.linalg.solve(lower, rhs), atol=1e-12)
    backward = band.backward(rhs.reshape(blocks, size, columns))
    np.testing.assert_allclose(backward.reshape(-1, columns), np.linalg.solve(lower.T, rhs), atol=1e-12)
    solution = band.backward(forward).reshape(-1, columns)
    np.testing.assert_allclose(dense @ solution, rhs, atol=1e-10)


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("cut", [1, 3, 5])
def test_two_parts_of_a_matrix_do_as_the_whole(cut, columns):
    """What the first part leaves to the second, and takes back of it."""
    _, diagonal, below = random_system(6, 4)
    rhs = np.random.default_rng(1).normal(size=(6, 4, columns))
    whole = BlockBand.factor(diagonal, below)
    first = BlockBand.factor(diagonal[:cut], below[:cut])
    begun, rest = first.forward(rhs[:cut]), rhs[cut:].copy()
    reach, left = first.below[-1], diagonal[cut:].copy()
    left[0] -= reach @ reach.T
    rest[0] -= reach @ begun[-1]
    second = BlockBand.factor(left, below[cut:])
    ended = second.backward(second.forward(rest))
    solution = np.concatenate([first.backward(begun, ended[0]), ended])
    np.testing.assert_allclose(solution, whole.backward(whole.forward(rhs)), atol=1e-12)


def test_a_matrix_that_is_not_positive_definite_is_refused():
    _, diagonal, below = random_system(4, 3)
    diagonal[2] -= 1e3 * np.eye(3)
    with pytest.raises(np.linalg.LinAlgError):
        BlockBand.factor(diagonal, below)


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
    block_tridiagonal.cholesky(matrix)
    np.testing.assert_allclose(matrix, lower, atol=exact * 100)
    assert not np.triu(matrix, 1).any()


def test_what_is_not_positive_definite_raises(given):
    matrix = given[0]
    matrix[2, 2] = -1.0
    with pytest.raises(np.linalg.LinAlgError):
        block_tridiagonal.cholesky(matrix)


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions(given, transposed):
    _, lower, rhs, left, exact = given
    solution = rhs.copy()
    block_tridiagonal.solve_lower(lower, solution, transposed)
    np.testing.assert_allclose((lower.T if transposed else lower) @ solution, rhs, atol=10 * exact)
    across = left.copy()
    block_tridiagonal.solve_lower_from_right(lower, across)
    np.testing.assert_allclose(across @ lower.T, left, atol=10 * exact)


def test_squares_and_products_are_taken_off(given):
    matrix, lower, rhs, left, exact = given
    target = matrix.copy()
    block_tridiagonal.subtract_square(target, rhs)
    np.testing.assert_allclose(np.tril(target), np.tril(matrix - rhs @ rhs.T), atol=100 * exact)
    target = np.zeros((4, 3), rhs.dtype)
    block_tridiagonal.subtract_product(target, left, rhs)
    np.testing.assert_allclose(target, -left @ rhs, atol=10 * exact)
    target = np.zeros((5, 3), rhs.dtype)
    block_tridiagonal.subtract_product(target, lower, rhs, transposed=True)
    np.testing.assert_allclose(target, -lower.T @ rhs, atol=100 * exact)
