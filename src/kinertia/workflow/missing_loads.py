"""Leaves the gain of a plate nominal where part of its load is missing."""

from dataclasses import replace

from kinertia.estimation.prepared import Prepared
from kinertia.estimation.simultaneous.calibration_entry import GAIN
from kinertia.estimation.simultaneous.fit import SimultaneousFit

_BEYOND_EDGE = "P282"


def without_gains_of_missing_loads(ready: Prepared, fitted: SimultaneousFit) -> Prepared | None:
    """Return the person with incomplete plates: of their contacts, part of the load is missing.

    A plate is incomplete where the estimate shows it, or where a foot extends beyond its edge and it seems to read too
    little. None if there is none.
    """
    beyond = {one.where.plate for one in ready.findings if one.code == _BEYOND_EDGE}
    light = {
        one.plate for one in fitted.posterior.instrument_errors if one.quantity == GAIN and one.found and one.value < 0
    }
    incomplete = {one.plate for one in fitted.posterior.missing_loads} | {name for name in beyond & light if name}
    if not incomplete:
        return None
    instruments = replace(ready.uncertainty.instruments, incomplete=frozenset(incomplete))
    return replace(ready, uncertainty=replace(ready.uncertainty, instruments=instruments))
