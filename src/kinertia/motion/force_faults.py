"""Do the forces belong to the motion? Wrong directions, signs and zeros of force plates, before any model.

The ground accelerates the body as the markers show it: forces integrated over time are the changes of the velocity of
the centre of mass, and the pelvis moves nearly as that does. On sound walks the two correlate by 0.7 and more along
each horizontal axis, and their trends agree within 8 N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, Trial

_PELVIS_HZ = 6.0
_OPPOSED = -0.4
_LEAST_CHANGE_M_S = 0.02
"""Velocities that change by less (standard deviation) say nothing about the sign of forces."""
_LEAST_WINDOW_S = 0.4
OFFSET_LIMIT_N = 20.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window."""
_HORIZONTAL = {"X": 0, "Z": 2}


@dataclass(frozen=True)
class Agreement:
    """How forces and markers agree along one horizontal axis, over a window.

    Attributes:
        correlation: of the velocity changes of the pelvis with those that the forces cause; NaN where one hardly moves.
        offset_n: trend of the difference as a force.
    """

    correlation: float
    offset_n: float


def direction_trouble(trial: Trial, pelvis: Sequence[str]) -> str:
    """Which horizontal forces point against the motion of the pelvis' markers; empty where none do."""
    found = agreement(trial, pelvis)
    against = {axis: one.correlation for axis, one in found.items() if one.correlation < _OPPOSED}
    if not against:
        return ""
    evidence = ", ".join(f"correlation {value:.2f} along {axis}" for axis, value in against.items())
    if len(against) == len(_HORIZONTAL):
        cause = "the forces are turned by 180 degrees about the vertical"
        remedy = "turn the forces, or the markers, before export"
    else:
        cause = f"the horizontal force along {next(iter(against))} has the wrong sign"
        remedy = "turn the sign of that axis of the plates before export"
    return f"{cause}: it accelerates the body against what the markers show ({evidence} of the velocities); {remedy}"


def offset_trouble(trial: Trial, pelvis: Sequence[str]) -> str:
    """A horizontal force that no motion of the pelvis' markers accounts for; empty where there is none."""
    found = agreement(trial, pelvis)
    off = {axis: one.offset_n for axis, one in found.items() if abs(one.offset_n) > OFFSET_LIMIT_N}
    if not off:
        return ""
    told = ", ".join(f"{value:+.0f} N along {axis}" for axis, value in off.items())
    return (
        f"the plates show {told} on average that do not accelerate the body; the zero of that axis is wrong: zero the "
        f"plates without load, or subtract it before export"
    )


def agreement(trial: Trial, pelvis: Sequence[str]) -> dict[str, Agreement]:
    """Forces against markers along X and Z over the longest measured window; empty where that is too short.

    Args:
        trial: in ground axes.
        pelvis: labels of markers on the pelvis; those that the trial lacks are left out.
    """
    worn = [label for label in pelvis if label in trial.markers.labels]
    if not worn or not trial.measured.any():
        return {}
    start, end = trial.windows()[0]
    place = trial.markers.select(worn).positions.mean(axis=1)
    seen = np.isfinite(place).all(axis=1)
    inside = (trial.loads.time >= start - 1e-9) & (trial.loads.time <= end + 1e-9)
    time = trial.loads.time[inside]
    if end - start < _LEAST_WINDOW_S or not seen.any() or len(time) < 10:
        return {}
    try:
        pelvis_m = smooth(trial.markers.time[seen], place[seen], _PELVIS_HZ)
    except SmoothingError:
        return {}
    shown = (time >= trial.markers.time[seen][0]) & (time <= trial.markers.time[seen][-1])
    time, force = time[shown], trial.loads.force[inside][shown].sum(axis=1)
    weight = float(force[:, 1].mean())
    if not weight > 0 or len(time) < 10:
        return {}
    mass_kg = weight / 9.81
    velocity = pelvis_m(time, 1)
    impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(time)[:, None], axis=0)
    caused = np.concatenate((np.zeros((1, 3)), impulse)) / mass_kg
    found = {}
    for axis, k in _HORIZONTAL.items():
        one, other = (_without_trend(time, values[:, k]) for values in (velocity, caused))
        still = min(one.std(), other.std()) < _LEAST_CHANGE_M_S
        correlation = np.nan if still else float(np.corrcoef(one, other)[0, 1])
        trend = float(np.polyfit(time - time.mean(), caused[:, k] - velocity[:, k], 1)[0])
        found[axis] = Agreement(correlation, mass_kg * trend)
    return found


def _without_trend(time: FloatArray, values: FloatArray) -> FloatArray:
    line = np.polyfit(time - time.mean(), values, 1)
    result: FloatArray = values - np.polyval(line, time - time.mean())
    return result
