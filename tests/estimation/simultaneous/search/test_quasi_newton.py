"""Steps that gradients along the way correct."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.estimation.simultaneous.search.quasi_newton import SecantPairs


def spd(seed: int, n: int) -> np.ndarray:
    rows = np.random.default_rng(seed).normal(size=(2 * n, n))
    return rows.T @ rows


@given(st.integers(0, 10_000), st.integers(2, 6))
def test_a_step_repeats_the_last_pair(seed, n):
    """The secant equation: the change of the gradient is answered with the step along which it was seen."""
    true, known = spd(seed, n), spd(seed + 1, n)
    rng = np.random.default_rng(seed)
    pairs = SecantPairs()
    for step in rng.normal(size=(2, n)):
        pairs = pairs.with_pair(step, true @ step, expected=float(step @ true @ step))
    answer = pairs.step(pairs.changes[-1], lambda rhs: np.linalg.solve(known, rhs))
    np.testing.assert_allclose(answer, pairs.steps[-1], rtol=1e-6, atol=1e-8)


def test_without_pairs_the_known_quadratic_answers():
    known, rhs = spd(0, 4), np.arange(4.0)
    answer = SecantPairs().step(rhs, lambda each: np.linalg.solve(known, each))
    np.testing.assert_array_equal(answer, np.linalg.solve(known, rhs))


def test_it_finds_the_optimum_of_a_quadratic_that_is_known_badly():
    """Directions known twice too stiff, twice too soft and well: as many pairs as kinds of directions, and one more."""
    n, rng = 30, np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(n, n)))[0]
    wrong = np.repeat([0.5, 1.0, 2.2], 10)
    true, rhs, x = basis @ np.diag(wrong) @ basis.T, rng.normal(size=n), np.zeros(n)
    pairs, best = SecantPairs(), np.linalg.solve(true, rhs)
    for _ in range(8):
        left = rhs - true @ x
        step = pairs.step(left, lambda each: each.copy())
        step *= (left @ step) / (step @ true @ step)
        x, pairs = x + step, pairs.with_pair(step, true @ step, float(step @ step))
    assert np.linalg.norm(x - best) < 1e-6 * np.linalg.norm(best)


@pytest.mark.parametrize("curvature", [-1.0, 0.0, 0.01])
def test_a_change_without_curvature_says_nothing(curvature):
    step = np.array([1.0, 0.0])
    assert len(SecantPairs().with_pair(step, curvature * step, expected=1.0).steps) == 0


def test_information_gained_is_in_all_changes():
    true, more = spd(0, 3), np.diag([2.0, 3.0])
    pairs = SecantPairs()
    for step in np.eye(3):
        pairs = pairs.with_pair(step, true @ step, expected=float(step @ true @ step))
    stiffer = true.copy()
    stiffer[1:, 1:] += more
    np.testing.assert_allclose(pairs.stiffer(slice(1, 3), more).changes, stiffer)
