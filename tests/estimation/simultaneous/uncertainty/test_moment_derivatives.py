"""What a delay that is known to a deviation only does to loads, against many delays by chance."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.uncertainty.moment_derivatives import delayed_loads
from kinertia.motion.ground_reactions import GroundReactions

SD_S = 0.003
AT = np.arange(0.05, 0.45, 0.01)


def reactions(rise_s):
    """A foot of 700 N that lands at 0.2 s within a rise time, and one that sways slowly."""
    time = np.arange(0.0, 0.5, 0.001)
    wrench = np.zeros((len(time), 2, 6))
    wrench[:, 0, 1] = 700.0 / (1.0 + np.exp(-(time - 0.2) / rise_s))
    wrench[:, 1, 1] = 400.0 + 100.0 * np.sin(2.0 * np.pi * time)
    return GroundReactions(time, wrench, np.zeros((len(time), 2), dtype=int), np.zeros(wrench.shape), None)


@pytest.mark.parametrize("rise_s", [0.0003, 0.001, 0.02])
def test_mean_squares_are_those_of_delays_by_chance(rise_s):
    walk = reactions(rise_s)
    found = delayed_loads(walk, AT, SD_S)
    by_chance = np.random.default_rng(1).normal(0.0, SD_S, 2000)
    expected = np.mean([np.square(walk.at(AT + delay) - found.loads) for delay in by_chance], axis=0)
    squares = np.square(SD_S * found.slope) + np.square(found.residual).sum(axis=1)
    np.testing.assert_allclose(np.sqrt(squares), np.sqrt(expected), rtol=0.1, atol=5.0)
    rates = walk.with_rate(AT)[1]
    too_large = np.abs(SD_S * rates).max() / np.sqrt(expected).max()
    assert (too_large > 1.5) == (rise_s < SD_S / 2), "a derivative does not know how long a landing takes"


def test_where_loads_change_slowly_it_is_the_derivative():
    walk = reactions(0.02)
    found, plain = delayed_loads(walk, AT, 0.001), delayed_loads(walk, AT)
    np.testing.assert_allclose(found.slope, plain.slope, atol=0.01 * np.abs(plain.slope).max())
    assert np.sqrt(np.square(found.residual).sum(axis=1)).max() < 2.0
    assert plain.residual.shape == (len(AT), 0, 2, 6)
    np.testing.assert_array_equal(plain.slope, walk.with_rate(AT)[1])
