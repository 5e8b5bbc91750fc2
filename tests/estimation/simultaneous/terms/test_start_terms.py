import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import NormalEquations
from kinertia.estimation.simultaneous.terms.start_terms import add_start
from validation.study_bound import dense_band


def terms(moved: np.ndarray) -> NormalEquations:
    """Of a trial of so many splines in one block."""
    size, c = moved.shape
    basis = MotionBasis(np.linspace(0.0, 0.05 * (size - 5), 2 * size), 0.05)
    normal = NormalEquations.zero(size, c, 1)
    add_start(normal, TimeBlock.whole(basis), moved)
    return normal


def test_a_constant_offset_is_free_however_long_the_trial():
    """Ten minutes must not know an angle that markers in wrong places show wrongly: by 0.1 rad, which is much."""
    offset = np.full((12_000, 2), 0.1)
    normal = terms(offset)
    assert normal.cost < 0.2
    assert np.abs(normal.rhs).max() < 2e-4


def test_what_nothing_shows_goes_where_its_neighbours_go():
    """A gap of ten splines between two that are known."""
    normal = terms(np.zeros((12, 1)))
    matrix = dense_band(normal.band)
    matrix[[0, -1], [0, -1]] += 1e6
    filled = np.linalg.solve(matrix, 1e6 * np.eye(12)[0] * 0.2 + 1e6 * np.eye(12)[-1] * 0.3)
    np.testing.assert_allclose(filled, np.linspace(0.2, 0.3, 12), atol=0.005)


def test_terms_are_those_of_their_cost():
    rng = np.random.default_rng(0)
    moved, step = rng.normal(size=(2, 9, 3))
    normal = terms(moved)
    ahead, behind = (terms(moved + sign * step) for sign in (1.0, -1.0))
    assert (behind.cost - ahead.cost) / 2.0 == pytest.approx((normal.rhs * step).sum())
    bent = step.ravel() @ dense_band(normal.band) @ step.ravel()
    assert ahead.cost + behind.cost - 2.0 * normal.cost == pytest.approx(bent)
