"""Moving means next to SciPy's filters."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from kinertia.motion.moving_mean import gaussian_mean, moving_mean

VALUES = np.random.default_rng(1).normal(size=(30, 2, 3))


@pytest.mark.parametrize("samples", [0.1, 0.7, 5.0, 40.0])
def test_gaussian(samples):
    expected = gaussian_filter1d(VALUES, samples, axis=0, mode="nearest")
    np.testing.assert_allclose(gaussian_mean(VALUES, samples), expected, atol=1e-14)


@pytest.mark.parametrize("samples", [1, 5, 29, 101])
def test_uniform(samples):
    expected = uniform_filter1d(VALUES, samples, axis=0, mode="nearest")
    np.testing.assert_allclose(moving_mean(VALUES, samples), expected, atol=1e-13)
