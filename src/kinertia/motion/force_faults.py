"""Do the forces belong to the motion? Wrong directions, signs and zeros of force plates, before any model.

The ground accelerates the body as the markers show it: forces integrated over time are the changes of the velocity of
the centre of mass. The pelvis moves nearly as that does when walking, the markers' centre when limbs swing (running),
but not when the trunk bends (squats). Along each horizontal axis the mean of both correlations with what the forces
cause is 0.5 and more on sound walks and runs, 0.2 in squats, and trends of pelvis and forces agree within 8 N.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.markers_centre import markers_centre
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, Trial

_PELVIS_HZ = 6.0
_OPPOSED = -0.4
_LEAST_CHANGE_M_S = 0.02
"""Velocities that change by less (standard deviation) say nothing about the sign of forces."""
_LEAST_WINDOW_S = 0.4
OFFSET_LIMIT_N = 20.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window."""
_CLEAR, _CLEAR_TURN, _TURNED_DEG = 0.7, 0.35, 60.0
_VERTICAL_FACTOR, _USUAL_FACTOR = (0.4, 1.8), 0.9
"""On 26 sound trials, from squats to runs, 0.67 to 0.99; at half the true rate it is four times as much."""
_HORIZONTAL = {"X": 0, "Z": 2}


@dataclass(frozen=True)
class Agreement:
    """How forces and markers agree along one horizontal axis, over a window.

    Attributes:
        correlation: of the velocity changes that the forces cause with those of the pelvis and of the markers' centre,
            mean of the two; NaN where nothing hardly moves.
        offset_n: trend of the difference as a force.
    """

    correlation: float
    offset_n: float


def direction_trouble(trial: Trial, owners: Mapping[str, str]) -> str:
    """Which horizontal forces point against the motion of the markers, and times that are not theirs; empty where
    neither.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    both = _velocities(trial, owners)
    if both is None:
        return ""
    if trouble := _time_scale_trouble(both):
        return trouble
    angle, strength = _turn(both)
    agreements = _agreement(both)
    against = {axis: one.correlation for axis, one in agreements.items() if one.correlation < _OPPOSED}
    # beside an axis that is opposed, one that goes with the markers says that they are not turned
    enough = -_OPPOSED if against else _CLEAR
    fitting = any(one.correlation > enough for one in agreements.values())
    evidence = ", ".join(f"correlation {value:.2f} along {axis}" for axis, value in against.items())
    if len(against) == len(_HORIZONTAL):
        cause = "the forces are turned by 180 degrees about the vertical"
        remedy = "turn the forces, or the markers, before export"
    elif strength > _CLEAR_TURN and abs(angle) > _TURNED_DEG and not fitting:
        nearest = 90 * round(angle / 90)
        cause = f"the forces are turned by {nearest} degrees about the vertical"
        remedy = "turn the forces, or the markers, before export"
        evidence = f"turned back by {angle:.0f} degrees, they correlate by {strength:.2f}"
    elif against:
        cause = f"the horizontal force along {next(iter(against))} has the wrong sign"
        remedy = "turn the sign of that axis of the plates before export"
    else:
        return ""
    return f"{cause}: it accelerates the body against what the markers show ({evidence} of the velocities); {remedy}"


def _time_scale_trouble(both: _Velocities) -> str:
    """A vertical velocity that is not what the forces cause by a factor: both are right, and the time is not."""
    shown, caused = (_without_trend(both.time, values[:, 1]) for values in (both.pelvis, both.caused))
    if min(shown.std(), caused.std()) < _LEAST_CHANGE_M_S:
        return ""
    factor = float((shown * caused).sum() / (shown * shown).sum())
    least, most = _VERTICAL_FACTOR
    if np.corrcoef(shown, caused)[0, 1] < _CLEAR or least < factor < most:
        return ""
    rate = float(np.sqrt(factor / _USUAL_FACTOR))
    return (
        f"the forces move the body up and down {factor:.2g} times as fast as the markers show (0.7 to 1 times is "
        f"usual): markers and forces run at {'less' if rate > 1 else 'more'} than their true rate, by a factor of "
        f"about {max(rate, 1 / rate):.2g}; correct the frame rate of the file"
    )


def _turn(both: _Velocities) -> tuple[float, float]:
    """The angle (deg) about the vertical by which the forces' velocities are turned from the markers', and how well
    both correlate once it is taken back: of the mean over pelvis and markers' centre.
    """
    # from Z to X is a positive turn about Y
    caused, *shown = (
        _without_trend(both.time, part[:, 2]) + 1j * _without_trend(both.time, part[:, 0])
        for part in (both.caused, both.pelvis, both.centre)
    )
    sizes = [max(float(np.linalg.norm(caused) * np.linalg.norm(part)), 1e-12) for part in shown]
    turn = sum(complex(np.vdot(part, caused)) / size for part, size in zip(shown, sizes, strict=True)) / len(shown)
    return float(np.degrees(np.angle(turn))), abs(turn)


def offset_trouble(trial: Trial, owners: Mapping[str, str]) -> str:
    """A horizontal force that no motion of the pelvis' markers accounts for; empty where there is none."""
    agreements = agreement(trial, owners)
    off = {axis: one.offset_n for axis, one in agreements.items() if abs(one.offset_n) > OFFSET_LIMIT_N}
    if not off:
        return ""
    shown = ", ".join(f"{value:+.0f} N along {axis}" for axis, value in off.items())
    return (
        f"the plates show {shown} on average that do not accelerate the body; the zero of that axis is wrong: zero the "
        f"plates without load, or subtract it before export"
    )


def agreement(trial: Trial, owners: Mapping[str, str]) -> dict[str, Agreement]:
    """Forces against markers along X and Z over the longest measured window; empty where that is too short.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    both = _velocities(trial, owners)
    return {} if both is None else _agreement(both)


def _agreement(both: _Velocities) -> dict[str, Agreement]:
    agreements = {}
    for axis, k in _HORIZONTAL.items():
        caused, *shown = (_without_trend(both.time, part[:, k]) for part in (both.caused, both.pelvis, both.centre))
        still = min(part.std() for part in (caused, *shown)) < _LEAST_CHANGE_M_S
        correlation = np.nan if still else float(np.mean([np.corrcoef(caused, part)[0, 1] for part in shown]))
        time = both.time - both.time.mean()
        trend = float(np.polyfit(time, both.caused[:, k] - both.pelvis[:, k], 1)[0])
        agreements[axis] = Agreement(correlation, both.mass_kg * trend)
    return agreements


@dataclass(frozen=True, eq=False)
class _Velocities:
    """(n, 3) m/s over (n,) s: of the pelvis, of the markers' centre, and of a body of this mass as the forces cause
    them.
    """

    time: FloatArray
    pelvis: FloatArray
    centre: FloatArray
    caused: FloatArray
    mass_kg: float


def _velocities(trial: Trial, owners: Mapping[str, str]) -> _Velocities | None:
    worn = [label for label in trial.markers.labels if owners.get(label) == "pelvis"]
    whole = markers_centre(owners, trial.markers)
    if not worn or whole is None or not trial.measured.any():
        return None
    start, end = trial.windows()[0]
    place = trial.markers.select(worn).positions.mean(axis=1)
    seen = np.isfinite(place).all(axis=1)
    inside = (trial.loads.time >= start - 1e-9) & (trial.loads.time <= end + 1e-9)
    time = trial.loads.time[inside]
    if end - start < _LEAST_WINDOW_S or not seen.any() or len(time) < 10:
        return None
    try:
        pelvis_m, centre_m = (smooth(trial.markers.time[seen], part[seen], _PELVIS_HZ) for part in (place, whole))
    except SmoothingError:
        return None
    shown = (time >= trial.markers.time[seen][0]) & (time <= trial.markers.time[seen][-1])
    time, force = time[shown], trial.loads.force[inside][shown].sum(axis=1)
    weight = float(force[:, 1].mean()) if len(time) else 0.0
    if not weight > 0 or len(time) < 10:
        return None
    mass_kg = weight / GRAVITY_M_S2
    impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(time)[:, None], axis=0)
    caused = np.concatenate((np.zeros((1, 3)), impulse)) / mass_kg
    return _Velocities(time, pelvis_m(time, 1), centre_m(time, 1), caused, mass_kg)


def _without_trend(time: FloatArray, values: FloatArray) -> FloatArray:
    line = np.polyfit(time - time.mean(), values, 1)
    result: FloatArray = values - np.polyval(line, time - time.mean())
    return result
