"""How unlike a person is to the prior."""

import pytest
from scipy.special import chdtrc

from kinertia.estimation.simultaneous.unlike import chance_beyond


@pytest.mark.parametrize("count", [1, 2, 3, 10, 77, 120])
def test_the_tail_of_chi_squared(count):
    for distance2 in (0.0, 1e-3, 1.0, 50.0, 400.0):
        assert chance_beyond(distance2, count) == pytest.approx(chdtrc(count, distance2), rel=1e-9, abs=1e-15)
