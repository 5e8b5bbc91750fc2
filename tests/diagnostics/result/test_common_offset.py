"""Trials that do not show that all plates are displaced alike say so; a walk the other way, or a check, helps."""

import numpy as np
import pytest

from kinertia.diagnostics.result.plate_errors import common_offset
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior
from kinertia.settings import Instruments
from results import codes, context

FLOOR_X, FLOOR_Z = 10, 11
"""Places of the common offset among the unknowns of two plates, the floor and the delay."""


def shown(x_sd_m, z_sd_m):
    """What trials say that know the common offset to these deviations, if the plates' own positions are known."""
    information = np.diag([1e6] * 10 + [x_sd_m**-2, z_sd_m**-2, 1e8, 1e8])
    return InstrumentInformation(("left", "right"), information, np.zeros(14))


def test_along_the_walk_it_goes_unnoticed():
    (finding,) = common_offset(context(shown=shown(0.009, 0.002)))
    assert (finding.code, finding.where.plate, finding.where.axis) == ("P248", None, "fore-aft")
    assert finding.evidence["detectable_m"].value == pytest.approx(0.028, abs=0.002)


def test_in_a_short_window_along_both_axes():
    found = list(common_offset(context(shown=shown(0.012, 0.006))))
    assert codes(found) == ["P248", "P248"]
    assert [finding.where.axis for finding in found] == ["fore-aft", "mediolateral"]


def test_not_where_trials_show_it_or_the_positions_were_checked():
    assert list(common_offset(context(shown=shown(0.003, 0.003)))) == []
    checked = InstrumentPrior.stated(Instruments(plate_sd_mm=1.0))
    assert list(common_offset(context(shown=shown(0.009, 0.009), prior=checked))) == []
