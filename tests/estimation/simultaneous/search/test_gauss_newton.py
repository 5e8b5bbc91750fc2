"""Steps that gradients along the way correct."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture
from kinertia.estimation.simultaneous.search.gauss_newton import AdaptedPrior, SecantPairs


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
    answer = SecantPairs().step(rhs, lambda vector: np.linalg.solve(known, vector))
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
        step = pairs.step(left, lambda vector: vector.copy())
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


GAINS = ErrorPriors((FaultMixture(0.001, 0.03, 0.05),) * 2)


INFORMATION = 1e6


FAR = 1.0
"""Half a squared SD, as in the middle of a search."""


def posterior(adapted, information, rhs):
    whole = information + adapted.gaussian.precision
    return np.linalg.solve(whole, rhs + adapted.gaussian.pull), np.linalg.inv(whole)


def adapted_to(information, rhs, times=1, adapted=None):
    adapted = adapted or AdaptedPrior.at_first(GAINS)
    for _ in range(times):
        adapted = adapted.again(GAINS, *posterior(adapted, information, rhs), FAR)
    return adapted


def weighed(information):
    """Two gains that data leave undetermined between fault-free and faulty, and what they say of them."""
    known = information * np.eye(2)
    return known, known @ [0.0049, 0.0049]


def test_it_stays_where_nothing_has_changed():
    first = adapted_to(*weighed(INFORMATION))
    assert adapted_to(*weighed(INFORMATION), adapted=first) is first


@pytest.mark.parametrize("share", [0.5, 0.9, 1.5])
def test_a_negative_precision_is_never_used_with_other_data(share):
    """Although the errors are the same, their SDs would otherwise grow without limit, or have no real value."""
    first = adapted_to(*weighed(INFORMATION))
    assert np.linalg.eigvalsh(first.gaussian.precision).min() < -0.5 * INFORMATION
    data = weighed(share * INFORMATION)
    found, covariance = posterior(adapted_to(*data, times=3, adapted=first), *data)
    directly, expected = posterior(adapted_to(*data, times=3), *data)
    np.testing.assert_allclose(found, directly, rtol=1e-6)
    np.testing.assert_allclose(covariance, expected, rtol=1e-6)
