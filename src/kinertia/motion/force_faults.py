"""Do the forces belong to the motion? Wrong axes, signs, units and zeros of force plates, before any model.

The ground accelerates the body as the markers show it: forces integrated over time are the changes of the velocity of
the centre of mass, and the pelvis moves nearly as that does. On sound walks the two correlate by 0.7 and more along
each horizontal axis, and their trends agree within 8 N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads, Trial

_FIRM_LOAD_N = 5 * LOAD_THRESHOLD_N
_LONGEST_ARM_M = 0.15
"""Free moment over vertical force; that of feet on the ground stays below 0.04 m."""
_PELVIS_HZ = 6.0
_OPPOSED = -0.4
_LEAST_CHANGE_M_S = 0.02
"""Velocities that change by less (standard deviation) say nothing about the sign of forces."""
_LEAST_WINDOW_S = 0.4
OFFSET_LIMIT_N = 20.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window."""
_HORIZONTAL = {"X": 0, "Z": 2}


def loads_trouble(plates: PlateLoads) -> str:
    """What is wrong with the axes or units of the plates' loads by themselves; empty where nothing is."""
    peaks = np.abs(plates.force).max(axis=(0, 1), initial=0.0)
    axis = "XYZ"[int(np.argmax(peaks))]
    if axis != "Y" and peaks[1] < 0.7 * peaks.max():
        return (
            f"the largest forces point along {axis} ({peaks.max():.0f} N) and not along Y ({peaks[1]:.0f} N), which is "
            f"up in the markers; export forces and markers in the same axes"
        )
    wrench = np.concatenate((plates.force, plates.moment), axis=2)
    arms = np.abs(_free_moment(wrench))[plates.force[..., 1] > _FIRM_LOAD_N]
    arms /= plates.force[..., 1][plates.force[..., 1] > _FIRM_LOAD_N]
    typical = float(np.median(arms)) if arms.size else 0.0
    if typical > _LONGEST_ARM_M:
        return (
            f"the torques are those of vertical forces at {typical:.2g} m from the foot; expected less than 0.04 m: "
            f"they are in N mm, or not about the centre of pressure; export them in N m, about the point of the force"
        )
    return ""


def _free_moment(wrench: FloatArray) -> FloatArray:
    point = centre_of_pressure(wrench)
    result: FloatArray = (wrench[..., 3:] - np.cross(point, wrench[..., :3]))[..., 1]
    return result


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
    caused = cumulative_trapezoid(force, time, axis=0, initial=0.0) / mass_kg
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
