"""How long strides and steps last, from the loads under the feet."""

from __future__ import annotations

from itertools import combinations, pairwise

from kinertia.trial.data import FEET, FootLoads, runs
from kinertia.trial.ground_contact import bridged


def periods(loads: FootLoads) -> tuple[list[float], list[float]]:
    """Times (s) between landings, and between leavings, of one foot; and from each to the other foot's next."""
    strides, steps = [], []
    contacts = [runs(bridged(loads.time, loads.force[:, foot, 1] > 0)) for foot in range(len(FEET))]
    for edge, unseen in ((0, 0), (1, len(loads.time) - 1)):  # what lasts to the end of the recording has no event there
        events = [[float(loads.time[run[edge]]) for run in spans if run[edge] != unseen] for spans in contacts]
        strides += [b - a for times in events for a, b in combinations(times, 2)]
        both = sorted((time, foot) for foot, times in enumerate(events) for time in times)
        steps += [b - a for (a, one), (b, other) in pairwise(both) if one != other]
    return strides, steps
