"""Is one plate alone wrong along a horizontal axis: its sign, its zero or its gain?

Judged is which single correction lets the forces move the body as its markers show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.evidence.caused_velocity import CausedVelocity
from kinertia.diagnostics.evidence.unexplained_velocity import TOLD_APART, Scaled, Unexplained
from kinertia.diagnostics.plates.force_faults import HORIZONTAL, OFFSET_WINDOW_S, offset_trouble
from kinertia.trial.data import PlateLoads
from kinertia.trial.sampled_time import span_s

_ONE_TURNED, _CLEARLY_BEST, _LEAST_TURNED_M_S = 0.65, 0.85, 0.08
"""Where one plate's sign is wrong, turning it leaves 0.04 to 0.57 of the difference of velocities on five trials; on
nine sound ones 0.9 (squats), 1.4 (runs) and more."""
_PLATE_OFFSET_N, _LEAST_ZERO_WINDOW_S, _LEAST_OFF_M_S = 12.0, 0.75, 0.05
_ZEROED, _USUALLY_LEFT_M_S = 0.75, 0.105
"""Of 31 sound trials zeros of one plate are up to 9 N; a drift of 40 N over a trial makes 13 to 24 N, and without it
the difference is as on sound walks and runs."""
_SCALED, _LEAST_GAIN_WINDOW_S, _FACTORS = 0.55, 1.0, ((0.4, 0.75), (1.35, 4.0))
"""Twice the force along one axis of a walk leaves 0.08 to 0.45 of the difference; of differences of sound trials that
are as large another gain leaves 0.72 and more, or another zero explains more. Beyond these factors it is no gain."""


def plate_sign_trouble(plates: PlateLoads, parts: Sequence[CausedVelocity]) -> str:
    """Which single plate has a horizontal force of the wrong sign, where others have it right; empty where none.

    With its sign turned, the forces must move the body much more as the markers show: more than with that of any other
    plate, or of all, or with another zero.

    Args:
        plates: as read.
        parts: the trial's `caused_velocities`, in the same axes.
    """
    if not parts or len(plates.names) < 2:
        return ""
    for axis, k in HORIZONTAL.items():
        left = _best_explained(plates, parts, k)
        best = int(np.argmin(left.plate_turned))
        turned = left.plate_turned[best]
        rivals = [left.all_turned, left.without_trend, *np.delete(left.plate_turned, best)]
        if turned > min(_ONE_TURNED * left.as_read, _CLEARLY_BEST * min(rivals)) or left.as_read < _LEAST_TURNED_M_S:
            continue
        zero = int(np.argmin(left.plate_zeroed))
        if left.plate_zeroed[zero] < TOLD_APART * turned:
            continue
        return (
            f"the horizontal force of {plates.names[best]} along {axis} has the wrong sign, and that of the other "
            f"plates has not: with it, what the forces cause differs from the velocity of the body by "
            f"{left.as_read:.2f} m/s (RMS), and by {turned:.3f} m/s once it is turned; turn the sign of that axis of "
            f"this plate (or correct the order of its corners) before export{left.or_zero(plates.names, zero, turned)}"
        )
    return ""


def _best_explained(plates: PlateLoads, parts: Sequence[CausedVelocity], k: int) -> Unexplained:
    """By pelvis and markers' centre, or, where that leaves less of long windows, by the centre alone: the pelvis of
    runners sways along the way.
    """
    shown = [parts]
    if max(span_s(part.time) for part in parts) >= _LEAST_GAIN_WINDOW_S:
        shown.append([replace(part, pelvis=part.centre) for part in parts])
    found = [Unexplained.of(plates.time, plates.force, each, k) for each in shown]
    return min(found, key=lambda one: min(one.as_read, float(one.plate_turned.min())))


def plate_offset_trouble(plates: PlateLoads, parts: Sequence[CausedVelocity]) -> str:
    """A horizontal force of one loaded plate that does not accelerate the body; empty where there is none, or where all
    plates show it (`offset_trouble`).

    Args:
        plates: as read.
        parts: the trial's `caused_velocities`, in the same axes.
    """
    long = [part for part in parts if span_s(part.time) >= _LEAST_ZERO_WINDOW_S]
    if not long:
        return ""
    longest_s = max(span_s(part.time) for part in long)
    for axis, k in HORIZONTAL.items():
        left = Unexplained.of(plates.time, plates.force, long, k)
        best = int(np.argmin(left.plate_zeroed))
        zero_n, zeroed = float(left.zero_n[best]), float(left.plate_zeroed[best])
        if left.as_read < _LEAST_OFF_M_S or zeroed > min(_ZEROED * left.as_read, _USUALLY_LEFT_M_S):
            continue
        if abs(zero_n) < _PLATE_OFFSET_N * max(1.0, OFFSET_WINDOW_S / longest_s):
            continue
        if min(one.left for one in left.scaled) < _CLEARLY_BEST * zeroed:
            continue
        names = [plates.names[p] for p in np.flatnonzero(left.plate_zeroed * _CLEARLY_BEST < zeroed)]
        alone = len(names) == 1 and zeroed < _CLEARLY_BEST * left.without_trend
        if not alone and offset_trouble(parts):
            return ""
        return (
            f"the zero of the horizontal force of {' or '.join(names)} along {axis} is wrong, or drifts: while "
            f"somebody stands on it, it shows {zero_n:+.0f} N that do not accelerate the body (what the forces cause "
            f"differs from its velocity by {left.as_read:.3f} m/s RMS, and by {zeroed:.3f} m/s without them); zero the "
            "plates before each trial, let the amplifiers warm up, or subtract what an unloaded plate reads before and "
            "after the step, unless something that is not measured was pushed (a handrail, a crutch)"
        )
    return ""


def axis_gain_trouble(plates: PlateLoads, parts: Sequence[CausedVelocity]) -> str:
    """A horizontal axis of one plate, or of all, that reads so many times as much as it should; empty where none does.

    Args:
        plates: as read.
        parts: the trial's `caused_velocities`, in the same axes.
    """
    long = [part for part in parts if span_s(part.time) >= _LEAST_GAIN_WINDOW_S]
    if not long:
        return ""
    for axis, k in HORIZONTAL.items():
        left = Unexplained.of(plates.time, plates.force, long, k)
        best = min(left.scaled, key=lambda one: one.left)
        rivals = [_SCALED * left.as_read, _CLEARLY_BEST * float(left.plate_zeroed.min())]
        if left.as_read < _LEAST_OFF_M_S or best.left > min(rivals) or not _is_gain(best):
            continue
        alike = [one for one in left.scaled if _CLEARLY_BEST * one.left < best.left and _is_gain(one)]
        names = ["all plates" if one.plate is None else plates.names[one.plate] for one in alike]
        return (
            f"the gain of the horizontal force of {' or '.join(names)} along {axis} is wrong: the body moves as its "
            f"markers show if it reads {best.factor:.2g} times what it should (what the forces cause differs from its "
            f"velocity by {left.as_read:.3f} m/s RMS, and then by {best.left:.3f} m/s); correct the scale factor of "
            "that channel, or its sensitivity in the calibration matrix, and export again"
        )
    return ""


def _is_gain(one: Scaled) -> bool:
    return any(low <= one.factor <= high for low, high in _FACTORS)
