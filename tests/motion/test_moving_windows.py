"""Moving means and extremes are SciPy's."""

import numpy as np
import pytest
from scipy import ndimage

from kinertia.motion.moving_windows import all_around, even_mean, gaussian_mean, greatest

SHAPES = [(1,), (2,), (17,), (300, 2, 1), (300, 3)]
SIZES = [1, 3, 21, 101]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("deviation", [0.05, 1.0, 7.77, 60.0])
def test_gaussian_mean(shape, deviation):
    values = np.random.default_rng(100).normal(size=shape)
    expected = ndimage.gaussian_filter1d(values, deviation, axis=0, mode="nearest")
    np.testing.assert_allclose(gaussian_mean(values, deviation), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("size", SIZES)
def test_even_windows(shape, size):
    values = np.random.default_rng(101).normal(size=shape)
    known = values > -2.0
    mean = ndimage.uniform_filter1d(values, size, axis=0, mode="nearest")
    np.testing.assert_allclose(even_mean(values, size), mean, rtol=0, atol=1e-14)
    assert np.array_equal(greatest(values, size), ndimage.maximum_filter1d(values, size, axis=0))
    inside = ndimage.minimum_filter1d(known, size, axis=0, mode="constant", cval=0)
    assert np.array_equal(all_around(known, size), inside)
