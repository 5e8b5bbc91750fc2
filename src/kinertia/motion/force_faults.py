"""Do the forces belong to the motion? Wrong directions, signs and zeros of force plates, before any model.

The ground accelerates the body as the markers show it: forces integrated over time are the changes of the velocity of
the centre of mass. The pelvis moves nearly as that does when walking, the markers' centre when limbs swing (running),
but not when the trunk bends (squats). Along each horizontal axis the mean of both correlations with what the forces
cause is 0.5 and more on sound walks and runs, 0.2 in squats, and trends of pelvis and forces agree within 8 N.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.motion.markers_centre import markers_centre
from kinertia.motion.smoothing import SmoothingError, smooth
from kinertia.trial.data import FloatArray, PlateLoads, Trial

_PELVIS_HZ = 6.0
_OPPOSED = -0.4
_LEAST_CHANGE_M_S = 0.02
"""Velocities that change by less (standard deviation) say nothing about the sign of forces."""
_LEAST_WINDOW_S = 0.4
OFFSET_LIMIT_N, _OFFSET_WINDOW_S = 20.0, 1.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window; over one that is shorter than
this, pelvis and centre of mass part by as much velocity in less time."""
_CLEAR, _CLEAR_TURN, _TURNED_DEG = 0.7, 0.35, 60.0
_VERTICAL_FACTOR, _USUAL_FACTOR = (0.4, 1.8), 0.9
"""On 26 sound trials, from squats to runs, 0.67 to 0.99; at half the true rate it is four times as much."""
_ONE_TURNED, _CLEARLY_BEST, _LEAST_TURNED_M_S = 0.65, 0.85, 0.1
"""Where one plate's sign is wrong, turning it leaves 0.04 to 0.57 of the difference of velocities on five trials; on
nine sound ones 0.9 (squats), 1.4 (runs) and more."""
_HORIZONTAL = {"X": 0, "Z": 2}


@dataclass(frozen=True)
class Agreement:
    """How forces and markers agree along one horizontal axis, over all measured windows.

    Attributes:
        correlation: of the velocity changes that the forces cause with those of the pelvis and of the markers' centre,
            mean of the two; NaN where nothing hardly moves.
        offset_n: trend of the difference as a force, the longer windows counting more.
        limit_n: up to which it is none.
    """

    correlation: float
    offset_n: float
    limit_n: float


def direction_trouble(trial: Trial, owners: Mapping[str, str]) -> str:
    """Which horizontal forces point against the motion of the markers, and times that are not theirs; empty where
    neither.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    parts = _velocities(trial, owners)
    if not parts:
        return ""
    changes = _Changes.of(parts)
    if trouble := _time_scale_trouble(changes):
        return trouble
    angle, strength = _turn(changes)
    agreements = _agreement(parts)
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


def _time_scale_trouble(changes: _Changes) -> str:
    """A vertical velocity that is not what the forces cause by a factor: both are right, and the time is not."""
    shown, caused = changes.pelvis[:, 1], changes.caused[:, 1]
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


def _turn(changes: _Changes) -> tuple[float, float]:
    """The angle (deg) about the vertical by which the forces' velocities are turned from the markers', and how well
    both correlate once it is taken back: of the mean over pelvis and markers' centre.
    """
    # from Z to X is a positive turn about Y
    caused, *shown = (part[:, 2] + 1j * part[:, 0] for part in (changes.caused, changes.pelvis, changes.centre))
    sizes = [max(float(np.linalg.norm(caused) * np.linalg.norm(part)), 1e-12) for part in shown]
    turn = sum(complex(np.vdot(part, caused)) / size for part, size in zip(shown, sizes, strict=True)) / len(shown)
    return float(np.degrees(np.angle(turn))), abs(turn)


def plate_sign_trouble(plates: PlateLoads, trial: Trial, owners: Mapping[str, str]) -> str:
    """Which single plate has a horizontal force of the wrong sign, where others have it right; empty where none.

    With its sign turned, the forces must move the body much more as the markers show: more than with that of any other
    plate, or of all, or with another zero.

    Args:
        plates: as read.
        trial: what became of them, in the same axes.
        owners: the segment that each marker is on.
    """
    parts = _velocities(trial, owners)
    if not parts or len(plates.names) < 2:
        return ""
    for axis, k in _HORIZONTAL.items():
        shown = _middled([(part.pelvis[:, k] + part.centre[:, k]) / 2 for part in parts])
        caused = _middled([part.caused[:, k] for part in parts])
        off = caused - shown
        turned = [
            off - 2.0 * _middled([_impulse(plates, p, k, part) for part in parts]) for p in range(len(plates.names))
        ]
        as_read, *of_plates = (float(np.std(each)) for each in (off, *turned))
        best = int(np.argmin(of_plates))
        zero_off = np.concatenate([_without_trend(part.time, part.caused[:, k] - part.centre[:, k]) for part in parts])
        rivals = [float(np.std(caused + shown)), float(np.std(zero_off)), *np.delete(of_plates, best)]
        least = min(_ONE_TURNED * as_read, _CLEARLY_BEST * min(rivals))
        if of_plates[best] > least or as_read < _LEAST_TURNED_M_S:
            continue
        return (
            f"the horizontal force of {plates.names[best]} along {axis} has the wrong sign, and that of the other "
            f"plates has not: with it, what the forces cause differs from the velocity of the body by {as_read:.2f} "
            f"m/s (RMS), and by {of_plates[best]:.2f} m/s once it is turned; turn the sign of that axis of this plate "
            "(or correct the order of its corners) before export"
        )
    return ""


def _impulse(plates: PlateLoads, p: int, k: int, part: _Velocities) -> FloatArray:
    """(n,) m/s that the force of one plate along one axis causes."""
    force = np.interp(part.time, plates.time, plates.force[:, p, k])
    impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(part.time))
    return np.concatenate(([0.0], impulse)) / part.mass_kg


def _middled(windows: Sequence[FloatArray]) -> FloatArray:
    """One after the other, each less its mean."""
    return np.concatenate([each - each.mean() for each in windows])


def offset_trouble(trial: Trial, owners: Mapping[str, str]) -> str:
    """A horizontal force that no motion of the pelvis' markers accounts for; empty where there is none."""
    agreements = agreement(trial, owners)
    off = {axis: one.offset_n for axis, one in agreements.items() if abs(one.offset_n) > one.limit_n}
    if not off:
        return ""
    shown = ", ".join(f"{value:+.0f} N along {axis}" for axis, value in off.items())
    return (
        f"the plates show {shown} on average that do not accelerate the body; the zero of that axis is wrong: zero the "
        f"plates without load, or subtract it before export"
    )


def agreement(trial: Trial, owners: Mapping[str, str]) -> dict[str, Agreement]:
    """Forces against markers along X and Z over the measured windows; empty where these are too short.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    parts = _velocities(trial, owners)
    return _agreement(parts) if parts else {}


def _agreement(parts: Sequence[_Velocities]) -> dict[str, Agreement]:
    changes = _Changes.of(parts)
    spans = np.array([np.ptp(part.time) for part in parts])
    limit = OFFSET_LIMIT_N * max(1.0, _OFFSET_WINDOW_S / float(spans.max()))
    agreements = {}
    for axis, k in _HORIZONTAL.items():
        caused, *shown = (part[:, k] for part in (changes.caused, changes.pelvis, changes.centre))
        still = min(part.std() for part in (caused, *shown)) < _LEAST_CHANGE_M_S
        correlation = np.nan if still else float(np.mean([np.corrcoef(caused, part)[0, 1] for part in shown]))
        trends = [
            part.mass_kg * np.polyfit(part.time - part.time.mean(), part.caused[:, k] - part.pelvis[:, k], 1)[0]
            for part in parts
        ]
        agreements[axis] = Agreement(correlation, float(np.average(trends, weights=spans**3)), limit)
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


@dataclass(frozen=True, eq=False)
class _Changes:
    """(n, 3) m/s: the same of all windows, one after the other, each without its trend."""

    pelvis: FloatArray
    centre: FloatArray
    caused: FloatArray

    @classmethod
    def of(cls, parts: Sequence[_Velocities]) -> _Changes:
        """Of these windows."""
        pelvis, centre, caused = (
            np.concatenate([_without_trend(part.time, getattr(part, name)) for part in parts])
            for name in ("pelvis", "centre", "caused")
        )
        return cls(pelvis, centre, caused)


def _velocities(trial: Trial, owners: Mapping[str, str]) -> list[_Velocities]:
    """Of every window in which the sum of the forces is known, if it is long enough."""
    worn = [label for label in trial.markers.labels if owners.get(label) == "pelvis"]
    whole = markers_centre(owners, trial.markers)
    if not worn or whole is None:
        return []
    place = trial.markers.select(worn).positions.mean(axis=1)
    seen = np.isfinite(place).all(axis=1)
    if not seen.any():
        return []
    try:
        pelvis_m, centre_m = (smooth(trial.markers.time[seen], part[seen], _PELVIS_HZ) for part in (place, whole))
    except SmoothingError:
        return []
    first, last = trial.markers.time[seen][[0, -1]]
    parts = []
    for start, end in trial.carried_windows():
        inside = (trial.loads.time >= max(start, first) - 1e-9) & (trial.loads.time <= min(end, last) + 1e-9)
        time, force = trial.loads.time[inside], trial.loads.force[inside].sum(axis=1)
        if len(time) < 10 or np.ptp(time) < _LEAST_WINDOW_S - 1e-9 or not force[:, 1].mean() > 0:
            continue
        mass_kg = float(force[:, 1].mean()) / GRAVITY_M_S2
        impulse = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(time)[:, None], axis=0)
        caused = np.concatenate((np.zeros((1, 3)), impulse)) / mass_kg
        parts.append(_Velocities(time, pelvis_m(time, 1), centre_m(time, 1), caused, mass_kg))
    return parts


def _without_trend(time: FloatArray, values: FloatArray) -> FloatArray:
    """Values (n, 3) less a line of each column."""
    after = time - time.mean()
    slope, level = np.polyfit(after, values, 1)
    result: FloatArray = values - after[:, None] * slope - level
    return result
