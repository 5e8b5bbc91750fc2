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


def contradiction(trial=None, severity=Severity.WARNING):
    masses = {"mass_by_force_kg": Quantity(70.0, "kg"), "stated_kg": Quantity(72.6, "kg")}
    return finding("S111", Where(trial=trial), severity, action=Quantity("Correct the mass"), **masses)


def test_plates_that_agree_are_not_scaled_to_it(prior):
    assert with_doubted_mass(prior, [contradiction()]).mass_sd_kg == pytest.approx(2.6)


def test_else_the_stated_mass_is_kept(prior):
    ignored = replace(contradiction(), status="ignored")
    waived = replace(contradiction(severity=Severity.ERROR), status="waived")
    for one in (contradiction("walk"), ignored, waived, contradiction().muted("P281")):
        assert with_doubted_mass(prior, [one]) is prior
    assert np.isclose(with_doubted_mass(prior, []).mass_sd_kg, prior.mass_sd_kg)
