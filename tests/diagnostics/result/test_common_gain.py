"""All plates with the same gain: the scale did not weigh what they carried, or one amplifier."""

import pytest

from kinertia.diagnostics.result.common_gain import common_gain_warning
from kinertia.diagnostics.subject.force_mass import ForceMass
from kinertia.estimation.carried_mass import CarriedMass
from kinertia.estimation.simultaneous.instrument_warnings import instrument_warnings


def calibration(*gains, zero_n=0.0):
    entries = {
        f"plate {k}: gain": {"value": gain, "prior_sd": 0.007, "sd": 0.003, "unit": "1"}
        for k, gain in enumerate(gains, start=1)
    }
    return {**entries, "plate 1: zero z": {"value": zero_n, "prior_sd": 2.4, "sd": 0.5, "unit": "N"}}


def by_force(mass_kg):
    return [ForceMass("walk", mass_kg, 0.2, [0.0, 1.0], [mass_kg, mass_kg])]


CARRIED = CarriedMass.of(74.6, ())


def test_what_was_carried_comes_before_the_plates():
    found = calibration(-0.092, -0.094)
    assert instrument_warnings(found) == []
    sentence = common_gain_warning(found, by_force(82.5), CARRIED)
    assert "-9.2 % (plate 1), -9.4 % (plate 2)" in sentence
    assert "82.5 kg (walk); stated mass 74.6 kg (+10.6 %)" in sentence
    assert sentence.index("[[attached]]") < sentence.index("amplifier")


def test_a_mass_that_is_too_large_comes_before_the_plates():
    sentence = common_gain_warning(calibration(0.038, 0.045), by_force(71.5), CARRIED)
    assert "[[attached]]" not in sentence
    assert sentence.index("correct the mass") < sentence.index("handrail") < sentence.index("amplifier")


@pytest.mark.parametrize("gains", [(-0.09, 0.0), (-0.09, 0.09), (-0.09, -0.03), (0.004, 0.004), (-0.09,)])
def test_gains_that_are_not_alike_are_each_plates_own(gains):
    found = calibration(*gains)
    assert not common_gain_warning(found, by_force(82.5), CARRIED)
    assert len(instrument_warnings(found)) == sum(abs(gain) > 0.014 for gain in gains)


def test_all_else_of_such_plates_is_still_said():
    (plate,) = instrument_warnings(calibration(0.038, 0.045, zero_n=5.6))
    assert plate.startswith("Plate 1: offset of the horizontal force along z by +5.6 N (usual: within 2.4), corrected")


def test_forces_that_tell_no_mass_leave_the_gains():
    assert "plate 1" in common_gain_warning(calibration(-0.05, -0.05), [], CARRIED)
