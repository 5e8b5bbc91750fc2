import numpy as np
import pytest

from block_systems import random_system
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
