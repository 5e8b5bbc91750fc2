"""Left against right: what differs is named, and the error bars are those of a difference."""

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import BEYOND_SD, asymmetries
from kinertia.model.bsp import PARAMETERS, BodySegmentParameters
from kinertia.synthetic.walk import walking_subject


def symmetric(bsp):
    """The left side as the mirror image of the right."""
    table, image = bsp.table(), bsp.mirrored().table()
    left = np.array([name.endswith("_l") for name in bsp.segments])
    return BodySegmentParameters.from_table(bsp.segments, np.where(left[:, None], image, table))


PRIOR = literature_prior(symmetric(walking_subject().literature))
SEGMENTS = PRIOR.mean.segments


def changed(segment, parameter, sds):
    table = PRIOR.mean.table()
    column = PARAMETERS.index(parameter)
    table[SEGMENTS.index(segment), column] += sds * PRIOR.sd[SEGMENTS.index(segment), column] * np.sqrt(2 * (1 - 0.9))
    return BodySegmentParameters.from_table(SEGMENTS, table)


def test_a_mirrored_body_is_alike():
    pairs = asymmetries(PRIOR.mean, PRIOR.covariance)
    assert [pair.segment for pair in pairs] == ["thigh", "shank", "foot", "upper_arm", "forearm"]
    for pair in pairs:
        np.testing.assert_allclose(pair.difference, 0.0, atol=1e-12)
        assert pair.differing == ()


@pytest.mark.parametrize(("sds", "beyond"), [(2.6, False), (3.2, True)])
def test_a_difference_counts_beyond_its_own_error_bar(sds, beyond):
    (pair,) = (
        asymmetry
        for asymmetry in asymmetries(changed("foot_r", "mass", sds), PRIOR.covariance)
        if asymmetry.segment == "foot"
    )
    assert pair.differing == ((0,) if beyond else ())
    assert pair.sd[0] == pytest.approx(PRIOR.sd[SEGMENTS.index("foot_r"), 0] * np.sqrt(0.2), rel=1e-6)


def test_people_of_the_prior_are_called_alike_who_are_and_error_bars_hold():
    """Pairs drawn from the prior, seen with the prior's own covariance: few are called different."""
    rng, called, away = np.random.default_rng(0), [], []
    for _ in range(60):
        for pair in asymmetries(PRIOR.draw(rng), PRIOR.covariance):
            called.append(bool(pair.differing))
            away.append(pair.difference / pair.sd)
    assert np.mean(called) < 0.08
    assert np.mean(np.abs(away) < 1.96) == pytest.approx(0.95, abs=0.02)
    assert BEYOND_SD > 2.5
