"""Trials that cannot tell turned plates from sound ones say so; session mates that can, help."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.result.unseen_turn import least_turn_rad, unseen_turn_note
from kinertia.estimation.simultaneous.instruments import FLOOR_PRIOR, InstrumentInformation, InstrumentPrior

TURN = 4 + 2
"""Place of the turn among the unknowns of one plate, the floor and the clock."""


def shown(turn_sd_deg, shared_with_x=0.0):
    """What trials say that know the turn to this deviation, if the plate's place is known."""
    information = np.diag([1e6, 1e6, 1e4, 1e6, 1e6, 1e6, 1.0 / np.radians(turn_sd_deg) ** 2, 1e8])
    both = shared_with_x * np.sqrt(information[0, 0] * information[TURN, TURN])
    information[0, TURN] = information[TURN, 0] = both
    return InstrumentInformation(("left",), information, np.zeros(8))


@pytest.mark.parametrize("sd_deg", [0.3, 1.0, 1.6])
def test_from_there_on_turned_plates_are_likelier(sd_deg):
    """Bayes' factor of the data's own value, by simulation of neither: two normal densities."""
    prior = FLOOR_PRIOR["turn"]
    least = np.degrees(least_turn_rad(shown(sd_deg), InstrumentPrior()))

    def odds(value):
        wide, narrow = (np.hypot(sd_deg, np.degrees(own)) for own in (prior.faulty_sd, prior.sound_sd))
        density = [np.exp(-0.5 * (value / sd) ** 2) / sd for sd in (wide, narrow)]
        return prior.faulty_share * density[0] / ((1 - prior.faulty_share) * density[1])

    assert odds(0.99 * least) < 1.0 < odds(1.01 * least)


def test_what_is_shared_with_the_place_of_a_plate_is_not_known_of_the_turn():
    alone, shared = (least_turn_rad(shown(0.5, share), InstrumentPrior()) for share in (0.0, 0.99))
    assert shared > 1.05 * alone


def test_a_note_where_it_matters_only():
    assert unseen_turn_note(shown(0.2), InstrumentPrior()) == ""
    note = unseen_turn_note(shown(1.6), InstrumentPrior())
    assert note.startswith("these trials show a turn of all plates about the vertical from 5.4 degrees on")
    mates = replace(InstrumentPrior(), session=(shown(0.2),))
    assert unseen_turn_note(shown(1.6), mates) == ""
