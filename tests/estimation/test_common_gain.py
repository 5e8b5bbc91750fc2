"""What all plates read too little alike is the mass."""

import pytest

from kinertia.estimation.common_gain import at_common_gain, common_gain
from kinertia.estimation.prior import literature_prior
from kinertia.estimation.simultaneous.calibration_entry import GAIN, CalibrationEntry
from kinertia.synthetic.walk import walking_subject


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
