"""Finds the measured part of a recording: from the first load on a plate to the last, with a margin."""

from kinertia.diagnostics.evidence.plate_contacts import loads_on
from kinertia.trial.data import PlateLoads
from kinertia.trial.foot_motion import AROUND_LOAD_S


def contact_span_s(plates: PlateLoads) -> tuple[float, float] | None:
    """Find the first and last time (s) of the part used with loads on plates; None where no one steps on them.

    Before and after it people come and go: feet leave the cameras' view or markers are lost, which does not matter.
    """
    loads = [load for p in range(len(plates.names)) for load in loads_on(plates, p)]
    if not loads:
        return None
    first, last = min(load[0] for load in loads), max(load[1] for load in loads)
    return float(plates.time[first]) - AROUND_LOAD_S, float(plates.time[last]) + AROUND_LOAD_S
