"""Finds phases between contacts for what is no stride: stances that no heel strike follows, and landings.

A stance lasts from foot contact to foot off, a landing from the contact that ends a fall until the pelvis is lowest.
They are `Stride`s of another `phase`, so that curves and peaks are read from them alike.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.motion.gait_cycle import Phase, Stride, feet_under_pelvis
from kinertia.motion.kinematics import Kinematics
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, Trial
from kinertia.trial.ground_contact import bridged
from kinertia.trial.leg_coverage import stances_of
from kinertia.trial.sampled_time import runs, within

_SAME_STEP_S = 0.1
"""Largest difference between the beginnings of a stance and of the stride that it is part of."""
_LONGEST_LANDING_S, _SHORTEST_LANDING_S = 1.0, 0.03
_FALLING_M_S = 0.5
"""Least speed of a fall; in walking the pelvis moves up and down with at most 0.3 m/s."""
_MOSTLY = 0.5
"""A phase is on plates if the foot is loaded in so much of it."""


def contact_phases(skeleton: Skeleton, kinematics: Kinematics, strides: Sequence[Stride]) -> tuple[Stride, ...]:
    """Return the phases of feet on plates that are part of no stride and that markers show, right foot first.

    In a landing these are the landings, in squats there are none, in everything else there are stances.

    Args:
        skeleton: the calibrated model.
        kinematics: of the trial.
        strides: of the trial.
    """
    trial = kinematics.trial
    if trial.on_ground is None or trial.task == "squat":
        return ()
    found = _landings(skeleton, kinematics) if trial.task == "landing" else _stances(trial, strides)
    result: list[Stride] = []
    shown_from, shown_to = kinematics.spline.time[[0, -1]]
    for side, phase, start, end in found:
        if start < shown_from or end > shown_to:
            continue
        number = 1 + sum(one.side == side for one in result)
        other = _other_foot(trial, side, start, end) if phase == "stance" else (np.nan, np.nan)
        result.append(Stride(side, number, start, end, end, *other, True, phase))
    return tuple(result)


def _stances(trial: Trial, strides: Sequence[Stride]) -> Iterator[tuple[str, Phase, float, float]]:
    """Yield side, phase, first and last time of whole stances on plates with which no stride begins."""
    for one in stances_of(trial):
        part = any(each.side == one.side and abs(each.start_s - one.start_s) < _SAME_STEP_S for each in strides)
        if one.whole and not part and _on_plates(trial, FEET.index(one.side), one.start_s, one.end_s):
            yield one.side, "stance", one.start_s, one.end_s


def _other_foot(trial: Trial, side: str, start_s: float, end_s: float) -> tuple[float, float]:
    """Return when the other foot leaves the ground in a stance, and when it is back; NaN where it does not."""
    assert trial.on_ground is not None  # else there are no stances
    own = within(trial.markers.time, start_s, end_s)
    time, ground = trial.markers.time[own], trial.on_ground[own, 1 - FEET.index(side)]
    swing = np.flatnonzero(~ground)
    if not len(swing):
        return np.nan, np.nan
    lifts = float(time[swing[0]]) if swing[0] > 0 else np.nan
    return lifts, float(time[swing[-1] + 1]) if swing[-1] + 1 < len(time) else np.nan


def _landings(skeleton: Skeleton, kinematics: Kinematics) -> Iterator[tuple[str, Phase, float, float]]:
    """Yield side, phase, first and last time of landings on plates: contacts that begin while the pelvis falls.

    They begin with a frame of the markers: before it, the foot may have been on a box.
    """
    loads, feet = kinematics.trial.loads, feet_under_pelvis(skeleton, kinematics)
    height_m = feet.pelvis[:, 1]
    speed_m_s = np.gradient(height_m, feet.time)
    for foot, side in enumerate(FEET):
        for a, b in runs(bridged(loads.time, loads.force[:, foot, 1] >= LOAD_THRESHOLD_N)):
            start, end = float(loads.time[a]), float(loads.time[b])
            own = np.flatnonzero(within(feet.time, start, min(end, start + _LONGEST_LANDING_S)))
            if len(own) and speed_m_s[own[0]] <= -_FALLING_M_S:
                lowest = int(np.argmin(height_m[own]))
                # otherwise the contact or the record ends before the pelvis rises again
                if lowest < len(own) - 1 and feet.time[own[lowest]] - start >= _SHORTEST_LANDING_S:
                    yield side, "landing", float(feet.time[own[0]]), float(feet.time[own[lowest]])


def _on_plates(trial: Trial, foot: int, start_s: float, end_s: float) -> bool:
    own = within(trial.loads.time, start_s, end_s)
    return bool(own.any() and (trial.loads.force[own, foot, 1] >= LOAD_THRESHOLD_N).mean() >= _MOSTLY)
