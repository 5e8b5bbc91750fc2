"""Trials that know how far plates are apart, and hardly where they stand, say so when they find one off."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.plate_errors import plate_positions
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.findings.finding import Severity
from kinertia.settings import Instruments
from results import codes, context, error

LEFT = error("position", 0.018, 0.0036, 0.005, "m", "left", moved=2.0, axis="x")
RIGHT = replace(LEFT, plate="right", value=0.0)
OFF, ALIKE = (LEFT, RIGHT), (LEFT, replace(RIGHT, value=0.017))
FINE = (replace(LEFT, value=0.003), RIGHT)


def shown(plates, middle_sd_m, apart_sd_m=0.002):
    """What trials say that know the middle of all plates along x, and each plate's way from it, to these deviations."""
    size = 5 * len(plates)
    information = np.diag([*[1e6, 1e6, 1e4, 1e6, 1e6] * len(plates), 1.0, 1.0, 1e6, 1e6])
    along = np.arange(0, size, 5)
    mean = np.full((len(plates),) * 2, 1.0 / max(len(plates), 1))
    information[np.ix_(along, along)] = (np.eye(len(plates)) - mean) / apart_sd_m**2 + mean / middle_sd_m**2
    return InstrumentInformation(tuple(plates), information, np.zeros(size + 4))


def found(errors, plates, middle_sd_m=0.011, prior=None):
    return list(plate_positions(context(*errors, shown=shown(plates, middle_sd_m), prior=prior)))


def test_what_trials_hardly_show_is_ambiguous():
    correction, ambiguous = found(OFF, ("right", "left"))
    # one displaced plate is one warning: which plate it is
    assert (correction.code, correction.severity) == ("P246", Severity.CORRECTED)
    assert (ambiguous.code, ambiguous.severity) == ("P247", Severity.WARNING)
    assert (ambiguous.where.axis, ambiguous.where.plate) == ("fore-aft", None)
    assert ambiguous.evidence["difference_m"].value == pytest.approx(0.018)
    assert ambiguous.evidence["difference_sd_m"].value == pytest.approx(0.0014, abs=5e-5)
    assert ambiguous.evidence["mean_sd_m"].value == pytest.approx(0.0078, abs=5e-5)


def test_an_error_that_is_shared_out_among_plates_is_certain_as_a_difference_only():
    uncertain = replace(LEFT, value=0.010, sd=0.006), replace(RIGHT, value=-0.010, sd=0.006)
    assert codes(found(uncertain, ("right", "left"))) == ["P247"]


def test_a_difference_counts_where_neither_plate_is_notable():
    shared_out = replace(LEFT, value=0.006, sd=0.006), replace(RIGHT, value=-0.006, sd=0.006)
    assert codes(found(shared_out, ("right", "left"))) == ["P247"]


def test_an_apparent_error_stays_a_correction_beside_it():
    apparent, _ = found((replace(LEFT, moved=0.5), RIGHT), ("right", "left"))
    assert apparent.severity is Severity.CORRECTED


@pytest.mark.parametrize(
    ("errors", "plates", "middle_sd_m", "corrections"),
    [
        (FINE, ("right", "left"), 0.011, 0),
        (OFF, ("right", "left"), 0.002, 1),
        ((LEFT,), ("left",), 0.011, 1),
        ((), (), 0.011, 0),
    ],
    ids=["nothing is off", "walks in both directions", "a single plate", "no plate"],
)
def test_nothing_is_ambiguous_where_nothing_is_open(errors, plates, middle_sd_m, corrections):
    assert codes(found(errors, plates, middle_sd_m)) == ["P246"] * corrections


def test_equal_errors_are_reported_once_of_all_plates():
    (finding,) = found(ALIKE, ("right", "left"))
    assert (finding.code, finding.where.plate) == ("P246", None)
    assert finding.evidence["offset_m"].value == 0.018


def test_columns_of_the_same_name_are_one_plate():
    """Two walks in which a single column was loaded have no two plates to distinguish."""
    names = ("left (walk 1)", "left (walk 2)")
    left = tuple(replace(LEFT, plate=name) for name in names)
    assert codes(found(left, names)) == ["P246"]
    right = tuple(replace(RIGHT, plate=f"right (walk {k})") for k in (1, 2))
    both = ("right (walk 1)", *names, "right (walk 2)")
    assert codes(found((*left, *right), both)) == ["P246", "P246", "P247"]


def test_what_other_people_of_the_session_show_counts():
    plates = ("right", "left")
    prior = InstrumentPrior(session=(shown(plates, 0.002),))
    assert codes(found(OFF, plates, prior=prior)) == ["P246"]


def test_nothing_is_ambiguous_where_the_lab_has_checked_its_plates():
    stated = InstrumentPrior.stated(Instruments(plate_sd_mm=2.0))
    assert codes(found(OFF, ("right", "left"), prior=stated)) == ["P246"]
