"""A stated mass that several occasions on plates contradict is not what plates are scaled to."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.calibration_entry import GAIN, CalibrationEntry
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.synthetic.walk import walking_subject
from kinertia.workflow.doubted_mass import at_common_gain, common_gain, with_doubted_mass


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


def gains(*values, sd=0.02, trial="walk"):
    """Gain errors of plates in a trial, and those of all trials that it leaves undecided."""
    of_plates = {"kind": "plate", "quantity": GAIN, "unit": "1"}
    own = [
        CalibrationEntry(plate=f"plate {k}", trial=trial, value=value, prior_sd=0.018, sd=sd, **of_plates)
        for k, value in enumerate(values)
    ]
    lasting = [
        CalibrationEntry(plate=f"plate {k}", value=value / 4, prior_sd=0.007, sd=0.03, **of_plates)
        for k, value in enumerate(values)
    ]
    return lasting + own


@pytest.mark.parametrize("values", [(-0.0764, -0.107), (0.065, 0.066), (-0.05, -0.08, -0.06)])
def test_all_plates_alike(values):
    error, sd = common_gain(gains(*values))
    assert error == pytest.approx(sum(values) / len(values))
    prior = literature_prior(walking_subject().bsp)
    there = at_common_gain(prior, prior.mass_kg, (error, sd))
    assert there.mass_kg == pytest.approx((1 + error) * prior.mass_kg)
    assert there.mass_sd_kg == pytest.approx(sd * there.mass_kg)


@pytest.mark.parametrize(
    "values", [(-0.09,), (-0.09, 0.001), (-0.09, 0.08), (-0.15, -0.06), (-0.05, -0.08, -0.004), (0.01, 0.01)]
)
def test_a_plate_of_its_own(values):
    assert common_gain(gains(*values)) is None


def test_a_plate_that_nobody_stands_on_says_nothing():
    idle = gains(-0.08, 0.0, -0.09)
    idle[4] = gains(0.0, 0.0, sd=0.018)[3]
    error, _ = common_gain(idle)
    assert error == pytest.approx(-0.085)


def test_trials_that_differ_have_no_mass_in_common():
    first, second = gains(-0.08, -0.09), gains(0.002, -0.003, trial="second")
    assert common_gain([*first, *second[2:]]) is None
