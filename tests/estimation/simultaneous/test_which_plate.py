"""Trials that know how far plates are apart, and hardly where they stand, say so when they find one off."""

import numpy as np
import pytest

from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.which_plate import which_plate_warnings
from kinertia.settings import Instruments

OFF = {"plate left: x": {"value": -0.018, "prior_sd": 0.0036, "sd": 0.005, "unit": "m"}}
ALIKE = {**OFF, "plate right: x": {**OFF["plate left: x"], "value": -0.017}}
SOUND = {"plate left: x": {"value": -0.003, "prior_sd": 0.0036, "sd": 0.005, "unit": "m"}}


def shown(plates, middle_sd_m, apart_sd_m=0.002):
    """What trials say that know the middle of all plates along x, and each plate's way from it, to these deviations."""
    size = 4 * len(plates)
    information = np.diag([*[1e6, 1e6, 1e4, 1e6] * len(plates), 1.0, 1.0, 1e6, 1e6])
    along = np.arange(0, size, 4)
    mean = np.full((len(plates),) * 2, 1.0 / max(len(plates), 1))
    information[np.ix_(along, along)] = (np.eye(len(plates)) - mean) / apart_sd_m**2 + mean / middle_sd_m**2
    return InstrumentInformation(tuple(plates), information, np.zeros(size + 4))


def test_what_trials_hardly_tell_is_said():
    (said,) = which_plate_warnings(OFF, shown(("right", "left"), 0.011), InstrumentPrior())
    assert said.startswith("one of the plates is displaced along x, by about 18 mm")
    assert "to 1.4 mm that plates differ" in said
    assert "to 7.8 mm where all" in said


@pytest.mark.parametrize(
    ("calibration", "plates", "middle_sd_m"),
    [
        (ALIKE, ("right", "left"), 0.011),
        (SOUND, ("right", "left"), 0.011),
        (OFF, ("right", "left"), 0.002),
        (OFF, ("left",), 0.011),
        ({}, (), 0.011),
    ],
    ids=["all are off alike", "nothing is off", "walks in both directions", "a single plate", "no plate"],
)
def test_nothing_is_said_where_nothing_is_open(calibration, plates, middle_sd_m):
    assert which_plate_warnings(calibration, shown(plates, middle_sd_m), InstrumentPrior()) == []


def test_columns_of_the_same_name_are_one_plate():
    """Two walks in which a single column was loaded have no two plates to tell apart."""
    names = ("left (walk 1)", "left (walk 2)")
    assert which_plate_warnings(OFF, shown(names, 0.011), InstrumentPrior()) == []
    both = ("right (walk 1)", *names, "right (walk 2)")
    left_off = {f"plate {name}: x": OFF["plate left: x"] for name in names}
    assert len(which_plate_warnings(left_off, shown(both, 0.011), InstrumentPrior())) == 1


def test_what_other_people_of_the_session_tell_counts():
    plates = ("right", "left")
    prior = InstrumentPrior(session=(shown(plates, 0.002),))
    assert which_plate_warnings(OFF, shown(plates, 0.011), prior) == []


def test_nothing_is_said_where_the_laboratory_has_checked_its_plates():
    stated = InstrumentPrior.stated(Instruments(plate_sd_mm=2.0))
    assert which_plate_warnings(OFF, shown(("right", "left"), 0.011), stated) == []
