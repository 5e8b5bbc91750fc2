"""Do the forces belong to the motion? Wrong directions, signs and zeros of force plates, before any model.

The ground accelerates the body as the markers show it: forces integrated over time are the changes of the velocity of
the centre of mass. The pelvis moves nearly as that does when walking, the markers' centre when limbs swing (running),
but not when the trunk bends (squats). Along each horizontal axis the mean of both correlations with what the forces
cause is 0.5 and more on sound walks and runs, 0.2 in squats, and trends of pelvis and forces agree within 8 N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import LEAST_CHANGE_M_S, CausedVelocity, VelocityChanges
from kinertia.diagnostics.evidence.unexplained_velocity import TOLD_APART, Unexplained
from kinertia.model.skeleton import GRAVITY_M_S2
from kinertia.trial.data import Trial

_OPPOSED = -0.4
OFFSET_LIMIT_N, OFFSET_WINDOW_S = 20.0, 1.0
"""Horizontal force that no acceleration of the body accounts for, mean over a window; over one that is shorter than
this, pelvis and centre of mass part by as much velocity in less time."""
_CLEAR, _CLEAR_TURN, _TURNED_DEG = 0.7, 0.35, 60.0
_VERTICAL_FACTOR, _USUAL_FACTOR = (0.4, 1.8), 0.9
"""On 26 sound trials, from squats to runs, 0.67 to 0.99; at half the true rate it is four times as much."""
HORIZONTAL = {"X": 0, "Z": 2}


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


def direction_trouble(trial: Trial, parts: Sequence[CausedVelocity]) -> str:
    """Which horizontal forces point against the motion of the markers, and times that are not theirs; empty where
    neither.

    Args:
        trial: in ground axes.
        parts: its `caused_velocities`.
    """
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
        if one.correlation < _OPPOSED and not _one_zero_off(trial, parts, HORIZONTAL[axis])
    }
    # beside an axis that is opposed, one that goes with the markers says that they are not turned
    enough = -_OPPOSED if against else _CLEAR
    fitting = any(one.correlation > enough for one in agreements.values())
    evidence = ", ".join(f"correlation {value:.2f} along {axis}" for axis, value in against.items())
    if len(against) == len(HORIZONTAL):
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
    left = Unexplained.of(trial.loads.time, trial.loads.force, parts, k)
    return bool(left.plate_zeroed.min() < TOLD_APART * left.all_turned)


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


def offset_trouble(parts: Sequence[CausedVelocity]) -> str:
    """A horizontal force that no motion of the pelvis' markers accounts for; empty where there is none."""
    agreements = _agreement(parts) if parts else {}
    off = {axis: one.offset_n for axis, one in agreements.items() if abs(one.offset_n) > one.limit_n}
    if not off:
        return ""
    shown = ", ".join(f"{value:+.0f} N along {axis}" for axis, value in off.items())
    weight_n = GRAVITY_M_S2 * float(np.mean([part.mass_kg for part in parts]))
    tilt_deg = float(np.degrees(np.arctan(np.linalg.norm(list(off.values())) / weight_n)))
    return (
        f"the plates show {shown} on average that do not accelerate the body; if they read it while nobody stands "
        "on them, the zero of that axis is wrong: zero them, or subtract it before export; if not, a force acts that "
        "no plate measures (a hand on a rail, a stick, somebody who pulls or pushes): record again without it; or the "
        f"verticals of plates and cameras differ by {tilt_deg:.1f} degrees (weight along that axis): level the plates, "
        "or calibrate the cameras on a level floor"
    )


def _agreement(parts: Sequence[CausedVelocity]) -> dict[str, Agreement]:
    """Forces against markers along X and Z over the measured windows."""
    changes = VelocityChanges.of(parts)
    spans = np.array([np.ptp(part.time) for part in parts])
    limit = OFFSET_LIMIT_N * max(1.0, OFFSET_WINDOW_S / float(spans.max()))
    agreements = {}
    for axis, k in HORIZONTAL.items():
        caused, *shown = (part[:, k] for part in (changes.caused, changes.pelvis, changes.centre))
        still = min(part.std() for part in (caused, *shown)) < LEAST_CHANGE_M_S
        correlation = np.nan if still else float(np.mean([np.corrcoef(caused, part)[0, 1] for part in shown]))
        trends = [
            part.mass_kg * np.polyfit(part.time - part.time.mean(), part.caused[:, k] - part.pelvis[:, k], 1)[0]
            for part in parts
        ]
        agreements[axis] = Agreement(correlation, float(np.average(trends, weights=spans**3)), limit)
    return agreements
