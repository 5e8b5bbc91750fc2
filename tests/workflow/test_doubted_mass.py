"""A stated mass that several occasions on plates contradict is not what plates are scaled to."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.synthetic.walk import walking_subject
from kinertia.workflow.doubted_mass import with_doubted_mass


@pytest.fixture(scope="module")
def prior():
    return literature_prior(walking_subject().bsp)


def contradiction(agreeing=2, severity=Severity.WARNING, trial=None):
    masses = {"mass_by_force_kg": Quantity(70.0, "kg", sd=0.4), "stated_kg": Quantity(72.6, "kg")}
    more = {"agreeing": Quantity(agreeing, "1"), "action": Quantity("Correct the mass")}
    return finding("S111", Where(trial=trial), severity, **masses, **more)


@pytest.mark.parametrize("trial", [None, "walk"])
def test_plates_that_agree_are_not_scaled_to_it(prior, trial):
    """A body of the same build, of their mass."""
    doubted = with_doubted_mass(prior, [contradiction(trial=trial)])
    assert (doubted.mass_kg, doubted.mass_sd_kg) == (pytest.approx(70.0), pytest.approx(0.4, abs=0.05))
    factor = 70.0 / 72.6
    assert doubted.mean.mass_kg == pytest.approx(factor * prior.mean.mass_kg)
    assert doubted.mean.com_m == pytest.approx(prior.mean.com_m)
    rows = np.array([factor, 1.0, 1.0, 1.0, *[factor] * 6])
    assert doubted.sd == pytest.approx(rows * prior.sd)


def test_else_the_stated_mass_is_kept(prior):
    ignored = replace(contradiction(), status="ignored")
    waived = replace(contradiction(severity=Severity.ERROR), status="waived")
    for one in (contradiction(1), ignored, waived, contradiction().muted("P281")):
        assert with_doubted_mass(prior, [one]) is prior
    assert with_doubted_mass(prior, []) is prior
