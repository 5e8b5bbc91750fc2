"""How long strides and steps last, from the loads under the feet."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

from kinertia.trial.data import FEET, FootLoads
from kinertia.trial.ground_contact import bridged
from kinertia.trial.sampled_time import runs

_TOGETHER = 0.2
"""Share of the time between two landings of a foot within which the other foot lands with it."""
_SHORTEST_STEP_S = 0.2
"""Feet that land or leave within less do so together: a sprinter's steps last longer."""


def periods(loads: FootLoads) -> tuple[list[float], list[float]]:
    """Times (s) between landings, and between leavings, of one foot; and from each to the other foot's next.

    Both are empty where the feet do not alternate, as in jumps, squats and when sitting down: there are no strides.
    """
    strides, steps = [], []
    contacts = [runs(bridged(loads.time, loads.force[:, foot, 1] > 0)) for foot in range(len(FEET))]
    for edge, unseen in ((0, 0), (1, len(loads.time) - 1)):  # what lasts to the end of the recording has no event there
        events = [[float(loads.time[run[edge]]) for run in spans if run[edge] != unseen] for spans in contacts]
        if not _alternating(*events):
            continue
        both = sorted((time, foot) for foot, times in enumerate(events) for time in times)
        between = [b - a for (a, one), (b, other) in pairwise(both) if one != other]
        if 2 * sum(round(step, 6) < _SHORTEST_STEP_S for step in between) > len(between):
            continue
        strides += [b - a for times in events for a, b in combinations(times, 2)]
        steps += between
    return strides, steps


def _alternating(right: Sequence[float], left: Sequence[float]) -> bool:
    """Whether events of one foot lie well between those of the other, as far as there are any."""
    phases = [
        (between - start) / (end - start)
        for own, other in ((right, left), (left, right))
        for start, end in pairwise(own)
        for between in other
        if start - _TOGETHER * (end - start) <= between < end + _TOGETHER * (end - start)
    ]
    apart = [_TOGETHER < phase < 1.0 - _TOGETHER for phase in phases]
    return 2 * sum(apart) >= len(apart)
