import numpy as np
import pytest

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture
from kinertia.estimation.simultaneous.search.adapted_prior import AdaptedPrior

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
