"""Splines next to SciPy's."""

import numpy as np
import pytest
from scipy import interpolate

from kinertia.model.splines import BSpline, basis, monotone, natural, not_a_knot

RNG = np.random.default_rng(3)


def samples(n):
    return np.cumsum(RNG.uniform(0.5, 2.0, n)), RNG.normal(size=(n, 2, 3))


@pytest.mark.parametrize("k", [0, 1, 2, 3, 5])
def test_values_and_derivatives_inside_and_beyond(k):
    t = np.sort(RNG.normal(size=12 + k))
    c = RNG.normal(size=(11, 2))
    x = np.append(np.linspace(t[k], t[-k - 1], 50), [t[k] - 0.1, t[-k - 1] + 0.1]).reshape(4, 13)
    for order in range(k + 2):
        expected = interpolate.BSpline(t, c, k)(x, order)
        np.testing.assert_allclose(BSpline(t, c, k)(x, order), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_the_active_splines_are_those_of_the_design_matrix():
    t, x = np.arange(12.0), np.linspace(5.0, 6.0, 9)
    first, values = basis(t, 5, x)
    dense = interpolate.BSpline.design_matrix(x, t, 5).toarray()
    rows = np.arange(len(x))[:, None]
    np.testing.assert_allclose(values.T, dense[rows, first[:, None] + np.arange(6)], atol=1e-15)


@pytest.mark.parametrize("n", [3, 4, 7, 40])
@pytest.mark.parametrize("k", [3, 5])
def test_natural_splines(n, k):
    x, y = samples(n)
    ends = [(order, np.zeros(y.shape[1:])) for order in range((k + 1) // 2, k)]
    theirs, own = interpolate.make_interp_spline(x, y, k, bc_type=(ends, ends)), natural(x, y, k)
    at = np.linspace(x[0], x[-1], 30)
    for order in range(3):
        np.testing.assert_allclose(own(at, order), theirs(at, order), atol=1e-11)


@pytest.mark.parametrize(("n", "k"), [(2, 1), (9, 1), (4, 3), (5, 3), (40, 3)])
def test_splines_without_knots_next_to_the_ends(n, k):
    x, y = samples(n)
    at = np.linspace(x[0], x[-1], 30)
    np.testing.assert_allclose(not_a_knot(x, y, k)(at), interpolate.make_interp_spline(x, y, k)(at), atol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4, 40])
def test_monotone_cubics(n):
    x, y = samples(n)
    y = y.reshape(n, -1).round()  # with equal neighbours
    at = np.linspace(x[0], x[-1], 100)
    np.testing.assert_allclose(monotone(x, y, at), interpolate.PchipInterpolator(x, y)(at), atol=1e-13)
