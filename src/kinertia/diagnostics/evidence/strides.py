"""Finds out whether a person takes strides while plates are loaded, and how long they last."""

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np

from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.trial.data import FEET, FootLoads
from kinertia.trial.ground_contact import bridged
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, runs, span_s

_TOGETHER = 0.2
"""Share of the time between two landings of a foot within which the other foot lands with it."""
_SHORTEST_STEP_S = 0.2
"""Feet that land or leave within less do so together: a sprinter's steps last longer."""
_LONGEST_SWING_S = 1.0
"""A foot that is in the air for longer is held up while the person lands on the other one."""


def periods(loads: FootLoads) -> tuple[list[float], list[float]]:
    """Return times (s) between foot contacts, and foot-offs, of one foot; and from each to the other foot's next.

    Both are empty where the feet do not alternate, as in jumps, squats and when sitting down: there are no strides.
    """
    strides, steps = [], []
    contacts = [runs(bridged(loads.time, loads.force[:, foot, 1] > 0)) for foot in range(len(FEET))]
    for edge, unseen in ((0, 0), (1, len(loads.time) - 1)):  # no event where a contact lasts to the end
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


def swing_in_turn(feet: tuple[FootTrajectory, FootTrajectory], part_s: tuple[float, float]) -> bool:
    """Return whether one foot swings and then the other, by their markers: one step on a plate shows no stride.

    Feet that leave and land together jump; a foot that lands while the other stays lifted is a landing.

    Args:
        feet: right and left.
        part_s: first and last time of the part that counts.
    """
    right, left = (
        [(leaves, lands) for leaves, lands in _swings(foot) if not (lands < part_s[0] or leaves > part_s[1])]
        for foot in feet
    )
    for swing in right if left else ():
        nearest = min(
            (_later_s(swing, other) for other in left), key=lambda later: abs(float(np.mean(later or np.inf)))
        )
        size = np.abs(np.round(nearest, 6))
        in_step = (size >= _SHORTEST_STEP_S) & (size <= _LONGEST_SWING_S)
        if nearest and in_step.all() and abs(np.sign(nearest).sum()) == len(nearest):
            return True
    return False


def _swings(foot: FootTrajectory) -> list[tuple[float, float]]:
    """Find when a foot leaves the ground and lands (NaN where not shown), except swings that are too long."""
    spans, time = foot.stance_spans, foot.time
    if not spans:
        return []
    edges = [
        (-np.inf, spans[0][0]),
        *((before[1], after[0]) for before, after in pairwise(spans)),
        (spans[-1][1], np.inf),
    ]
    frame_s = span_s(time) / max(len(time) - 1, 1)
    kept = []
    for leaves, lands in edges:
        lifted = foot.shown & (time > leaves) & (time < lands)
        if lifted.any() and lifted.sum() * frame_s <= _LONGEST_SWING_S + TIME_TOLERANCE_S:
            kept.append((leaves if np.isfinite(leaves) else np.nan, lands if np.isfinite(lands) else np.nan))
    return kept


def _later_s(swing: tuple[float, float], other: tuple[float, float]) -> list[float]:
    """Return the delays (s) of another swing's foot off and foot contact, where both are known."""
    return [second - first for first, second in zip(swing, other, strict=True) if np.isfinite(second - first)]


def _alternating(right: Sequence[float], left: Sequence[float]) -> bool:
    """Return whether the known events of one foot lie well between those of the other."""
    phases = [
        (between - start) / (end - start)
        for own, other in ((right, left), (left, right))
        for start, end in pairwise(own)
        for between in other
        if start - _TOGETHER * (end - start) <= between < end + _TOGETHER * (end - start)
    ]
    apart = [_TOGETHER < phase < 1.0 - _TOGETHER for phase in phases]
    return 2 * sum(apart) >= len(apart)
