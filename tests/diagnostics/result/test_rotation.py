"""Trials that do not distinguish rotated plates from fault-free ones say so; session mates that do, help."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.plate_errors import plate_rotation, smallest_detectable
from kinertia.estimation.simultaneous.instruments.priors import FLOOR_PRIOR, InstrumentInformation, InstrumentPrior
from kinertia.findings.finding import Severity
from results import codes, context, error

TURN = 5 + 2
"""Place of the rotation among the unknowns of one plate, the floor and the delay."""


def shown(turn_sd_deg, shared_with_x=0.0, of_one=1e12):
    """What trials say that know the rotation to this deviation, if the plate's position is known."""
    information = np.diag([1e6, 1e6, 1e4, 1e6, of_one, 1e6, 1e6, 1.0 / np.radians(turn_sd_deg) ** 2, 1e8])
    both = shared_with_x * np.sqrt(information[0, 0] * information[TURN, TURN])
    information[0, TURN] = information[TURN, 0] = both
    return InstrumentInformation(("left",), information, np.zeros(9))


@pytest.mark.parametrize("sd_deg", [0.3, 1.0, 1.6])
def test_from_there_on_rotated_plates_are_likelier(sd_deg):
    """Bayes' factor of the data's own value, by simulation of neither: two normal densities."""
    prior = FLOOR_PRIOR["turn"]
    least = np.degrees(smallest_detectable(shown(sd_deg), InstrumentPrior(), "turn"))

    def odds(value):
        wide, narrow = (np.hypot(sd_deg, np.degrees(error_sd)) for error_sd in (prior.faulty_sd, prior.nominal_sd))
        density = [np.exp(-0.5 * (value / sd) ** 2) / sd for sd in (wide, narrow)]
        return prior.fault_probability * density[0] / ((1 - prior.fault_probability) * density[1])

    assert odds(0.99 * least) < 1.0 < odds(1.01 * least)


def test_what_is_shared_with_the_position_of_a_plate_is_not_known_of_the_rotation():
    alone, shared = (smallest_detectable(shown(0.5, share), InstrumentPrior(), "turn") for share in (0.0, 0.99))
    assert shared > 1.05 * alone


def test_it_is_reported_where_it_matters_only():
    assert list(plate_rotation(context(shown=shown(0.2)))) == []
    (finding,) = plate_rotation(context(shown=shown(1.6)))
    assert finding.code == "P235"
    assert np.degrees(finding.evidence["detectable_rad"].value) == pytest.approx(4.04, abs=0.05)
    assert np.degrees(finding.evidence["of_one_rad"].value) < 1.0
    (single,) = plate_rotation(context(shown=shown(0.2, of_one=1.0 / np.radians(2.0) ** 2)))
    assert single.code == "P235"
    assert np.degrees(single.evidence["of_one_rad"].value) == pytest.approx(6.7, abs=0.7)
    mates = replace(InstrumentPrior(), session=(shown(0.2),))
    assert list(plate_rotation(context(shown=shown(1.6), prior=mates))) == []


def test_a_rotation_is_an_error_of_all_plates():
    rotated = [
        error("rotation", value, 0.02, 0.004, "rad", plate=plate) for plate, value in (("left", 0.05), ("right", 0.06))
    ]
    (finding,) = plate_rotation(context(*rotated, shown=shown(0.2)))
    assert (finding.code, finding.where.plate, finding.where.axis) == ("P234", None, None)
    assert finding.evidence["rotation_rad"].value == 0.06
    unsure = [replace(plate_error, sd=0.04) for plate_error in rotated]
    assert codes(plate_rotation(context(*unsure, shown=shown(0.2)))) == []


@pytest.mark.parametrize("other_rad", [0.001, -0.06])
def test_a_rotation_that_the_other_plate_does_not_share_is_the_plates_own(other_rad):
    first, other = (
        error("rotation", value, 0.02, 0.004, "rad", plate=plate)
        for plate, value in (("left", 0.09), ("right", other_rad))
    )
    found = list(plate_rotation(context(first, other, shown=shown(0.2))))
    assert codes(found) == ["P237"] * (2 if other.found else 1)
    assert found[0].where.plate == "left"
    assert found[0].evidence["rotation_rad"].value == 0.09


@pytest.mark.parametrize(("degrees", "severity"), [(9.0, Severity.CORRECTED), (-32.0, Severity.WARNING)])
def test_a_rotation_as_of_no_plate_stands_for_another_fault(degrees, severity):
    """Interchanged horizontal channels of one plate were "corrected" by a rotation of -32 degrees."""
    first, other = (
        error("rotation", np.radians(value), 0.02, 0.004, "rad", plate=plate)
        for plate, value in (("left", degrees), ("right", 0.1))
    )
    (found,) = plate_rotation(context(first, other, shown=shown(0.2)))
    assert (found.code, found.severity, found.where.plate) == ("P237", severity, "left")
