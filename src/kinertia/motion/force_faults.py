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

from kinertia.motion.caused_velocity import (
    LEAST_CHANGE_M_S,
    CausedVelocity,
    VelocityChanges,
    caused_velocities,
    without_trend,
)
from kinertia.trial.data import FloatArray, PlateLoads, Trial

_OPPOSED = -0.4
OFFSET_LIMIT_N, _OFFSET_WINDOW_S = 20.0, 1.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window; over one that is shorter than
this, pelvis and centre of mass part by as much velocity in less time."""
_CLEAR, _CLEAR_TURN, _TURNED_DEG = 0.7, 0.35, 60.0
_VERTICAL_FACTOR, _USUAL_FACTOR = (0.4, 1.8), 0.9
"""On 26 sound trials, from squats to runs, 0.67 to 0.99; at half the true rate it is four times as much."""
_ONE_TURNED, _CLEARLY_BEST, _LEAST_TURNED_M_S = 0.65, 0.85, 0.08
"""Where one plate's sign is wrong, turning it leaves 0.04 to 0.57 of the difference of velocities on five trials; on
nine sound ones 0.9 (squats), 1.4 (runs) and more."""
_TOLD_APART = 0.5
"""Across the walk a foot pushes to one side all the time: with the wrong sign it looks like another zero. On nine
trials what is true leaves 0.1 to 0.66 of what the other would, in one walk 0.7 to 1.7."""
_PLATE_OFFSET_N, _LEAST_PLATE_WINDOW_S, _LEAST_OFF_M_S, _ZEROED = 12.0, 0.75, 0.05, 0.75
"""Of 31 sound trials zeros of one plate are up to 9 N; a drift of 40 N over a trial makes 13 to 24 N."""
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
    parts = caused_velocities(trial, owners)
    if not parts:
        return ""
    changes = VelocityChanges.of(parts)
    if trouble := _time_scale_trouble(changes):
        return trouble
    angle, strength = _turn(changes)
    agreements = _agreement(parts)
    against = {
        axis: one.correlation
        for axis, one in agreements.items()
        if one.correlation < _OPPOSED and not _one_zero_off(trial, parts, _HORIZONTAL[axis])
    }
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


def _one_zero_off(trial: Trial, parts: Sequence[CausedVelocity], k: int) -> bool:
    """Whether a wrong zero under one foot accounts for more than turning the sign of all."""
    left = _Unexplained.of(trial.loads.time, trial.loads.force, parts, k)
    return bool(left.plate_zeroed.min() < _TOLD_APART * left.all_turned)


def _time_scale_trouble(changes: VelocityChanges) -> str:
    """A vertical velocity that is not what the forces cause by a factor: both are right, and the time is not."""
    factor = changes.times_up(changes.pelvis)
    least, most = _VERTICAL_FACTOR
    if factor is None or least < factor < most:
        return ""
    rate = float(np.sqrt(factor / _USUAL_FACTOR))
    return (
        f"the forces move the body up and down {factor:.2g} times as fast as the markers show (0.7 to 1 times is "
        f"usual): markers and forces run at {'less' if rate > 1 else 'more'} than their true rate, by a factor of "
        f"about {max(rate, 1 / rate):.2g}; correct the frame rate of the file"
    )


def _turn(changes: VelocityChanges) -> tuple[float, float]:
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
    parts = caused_velocities(trial, owners)
    if not parts or len(plates.names) < 2:
        return ""
    for axis, k in _HORIZONTAL.items():
        left = _Unexplained.of(plates.time, plates.force, parts, k)
        best = int(np.argmin(left.plate_turned))
        turned = left.plate_turned[best]
        rivals = [left.all_turned, left.without_trend, *np.delete(left.plate_turned, best)]
        if turned > min(_ONE_TURNED * left.as_read, _CLEARLY_BEST * min(rivals)) or left.as_read < _LEAST_TURNED_M_S:
            continue
        zero = int(np.argmin(left.plate_zeroed))
        if left.plate_zeroed[zero] < _TOLD_APART * turned:
            continue
        return (
            f"the horizontal force of {plates.names[best]} along {axis} has the wrong sign, and that of the other "
            f"plates has not: with it, what the forces cause differs from the velocity of the body by "
            f"{left.as_read:.2f} m/s (RMS), and by {turned:.3f} m/s once it is turned; turn the sign of that axis of "
            f"this plate (or correct the order of its corners) before export{left.or_zero(plates.names, zero, turned)}"
        )
    return ""


@dataclass(frozen=True, eq=False)
class _Unexplained:
    """m/s, along one axis: how far the velocity that the forces cause is from that of the body (RMS), as it is and by
    each of some mistakes.

    Attributes:
        as_read: none.
        all_turned: all plates have the wrong sign.
        without_trend: all plates have the same wrong zero.
        plate_turned, plate_zeroed: (p,) one plate has the wrong sign, or the wrong zero.
        zero_n: (p,) N, that zero.
    """

    as_read: float
    all_turned: float
    without_trend: float
    plate_turned: FloatArray
    plate_zeroed: FloatArray
    zero_n: FloatArray

    @classmethod
    def of(cls, time: FloatArray, force: FloatArray, parts: Sequence[CausedVelocity], k: int) -> _Unexplained:
        """Along X (0) or Z (2); forces (k, p, 3) N of plates, or of feet, over (k,) s."""
        body = _middled([(part.pelvis[:, k] + part.centre[:, k]) / 2 for part in parts])
        caused = _middled([part.caused[:, k] for part in parts])
        off = caused - body
        turned, zeroed, zero_n = [], [], []
        for own_force in np.moveaxis(force, 1, 0):
            own, one_newton = (
                _middled([part.by(time, each) for part in parts])
                for each in (own_force[:, k], (own_force[:, 1] > 0.0).astype(float))
            )
            zero_n.append(float(one_newton @ off) / max(float(one_newton @ one_newton), 1e-12))
            turned.append(np.std(off - 2.0 * own))
            zeroed.append(np.std(off - zero_n[-1] * one_newton))
        trends = np.concatenate([without_trend(part.time, part.caused[:, k] - part.centre[:, k]) for part in parts])
        return cls(
            float(np.std(off)),
            float(np.std(caused + body)),
            float(np.std(trends)),
            np.array(turned),
            np.array(zeroed),
            np.array(zero_n),
        )

    def or_zero(self, names: Sequence[str], zero: int, turned: float) -> str:
        """The other cause, where a zero of one plate accounts for as much."""
        if turned < _TOLD_APART * self.plate_zeroed[zero]:
            return ""
        return (
            f"; or the zero of that axis of {names[zero]} is off by {self.zero_n[zero]:+.0f} N: without that it is "
            f"{self.plate_zeroed[zero]:.3f} m/s, and a foot that pushes to one side all the time does not tell which; "
            "see what the plate reads while nobody stands on it"
        )


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


def plate_offset_trouble(plates: PlateLoads, trial: Trial, owners: Mapping[str, str]) -> str:
    """A horizontal force of one loaded plate that does not accelerate the body; empty where there is none, or where all
    plates show it (`offset_trouble`).

    Args:
        plates: as read.
        trial: what became of them, in the same axes.
        owners: the segment that each marker is on.
    """
    parts = [part for part in caused_velocities(trial, owners) if np.ptp(part.time) >= _LEAST_PLATE_WINDOW_S]
    if not parts:
        return ""
    longest_s = max(float(np.ptp(part.time)) for part in parts)
    for axis, k in _HORIZONTAL.items():
        left = _Unexplained.of(plates.time, plates.force, parts, k)
        best = int(np.argmin(left.plate_zeroed))
        zero_n, zeroed = float(left.zero_n[best]), float(left.plate_zeroed[best])
        if left.as_read < _LEAST_OFF_M_S or zeroed > _ZEROED * left.as_read:
            continue
        if abs(zero_n) < _PLATE_OFFSET_N * max(1.0, _OFFSET_WINDOW_S / longest_s):
            continue
        names = [plates.names[p] for p in np.flatnonzero(left.plate_zeroed * _CLEARLY_BEST < zeroed)]
        alone = len(names) == 1 and zeroed < _CLEARLY_BEST * left.without_trend
        if not alone and offset_trouble(trial, owners):
            return ""
        return (
            f"the zero of the horizontal force of {' or '.join(names)} along {axis} is wrong, or drifts: while "
            f"somebody stands on it, it shows {zero_n:+.0f} N that do not accelerate the body (what the forces cause "
            f"differs from its velocity by {left.as_read:.3f} m/s RMS, and by {zeroed:.3f} m/s without them); zero the "
            "plates before each trial, let the amplifiers warm up, or subtract what an unloaded plate reads before and "
            "after the step, unless something that is not measured was pushed (a handrail, a crutch)"
        )
    return ""


def agreement(trial: Trial, owners: Mapping[str, str]) -> dict[str, Agreement]:
    """Forces against markers along X and Z over the measured windows; empty where these are too short.

    Args:
        trial: in ground axes.
        owners: the segment that each marker is on.
    """
    parts = caused_velocities(trial, owners)
    return _agreement(parts) if parts else {}


def _agreement(parts: Sequence[CausedVelocity]) -> dict[str, Agreement]:
    changes = VelocityChanges.of(parts)
    spans = np.array([np.ptp(part.time) for part in parts])
    limit = OFFSET_LIMIT_N * max(1.0, _OFFSET_WINDOW_S / float(spans.max()))
    agreements = {}
    for axis, k in _HORIZONTAL.items():
        caused, *shown = (part[:, k] for part in (changes.caused, changes.pelvis, changes.centre))
        still = min(part.std() for part in (caused, *shown)) < LEAST_CHANGE_M_S
        correlation = np.nan if still else float(np.mean([np.corrcoef(caused, part)[0, 1] for part in shown]))
        trends = [
            part.mass_kg * np.polyfit(part.time - part.time.mean(), part.caused[:, k] - part.pelvis[:, k], 1)[0]
            for part in parts
        ]
        agreements[axis] = Agreement(correlation, float(np.average(trends, weights=spans**3)), limit)
    return agreements
