"""Finds peaks and impulses of joint moments and powers that gait studies report, with their standard deviations.

A peak has a value only where its whole phase is known: the largest value of a part is not the peak. A stance has its
peaks whether a heel strike follows or not; a landing has peaks of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinertia.estimation.cycles import UNITS, CycleCurve
from kinertia.motion.gait_cycle import PERCENT


@dataclass(frozen=True)
class Peak:
    """What is read from a curve.

    Attributes:
        name: in tables.
        quantity: of the curve, as in `cycles.csv`.
        sign: of the peak in this curve.
        phase: first and last share of stance, or of the stride if `of_stride`, in which it is.
        of_stride: whether the phase is a share of the stride.
        impulse: integral over time of values of this sign, in place of the peak.
    """

    name: str
    quantity: str
    sign: float
    phase: tuple[float, float]
    of_stride: bool = False
    impulse: bool = False


PEAKS = (
    Peak("knee adduction moment, external, first peak", "knee_adduction_joint_moment", -1.0, (0.0, 0.5)),
    Peak("knee adduction moment, external, second peak", "knee_adduction_joint_moment", -1.0, (0.5, 1.0)),
    Peak("knee adduction impulse, external", "knee_adduction_joint_moment", -1.0, (0.0, 1.0), impulse=True),
    Peak("knee extension moment, internal, early stance", "knee_flexion_joint_moment", -1.0, (0.0, 0.5)),
    Peak("ankle plantarflexion moment, internal, push-off", "ankle_flexion_joint_moment", -1.0, (0.5, 1.0)),
    Peak("ankle power, generated, push-off", "ankle_angle_power", 1.0, (0.5, 1.0)),
    Peak("hip flexion power, generated, pull-off", "hip_flexion_power", 1.0, (0.5, 0.8), of_stride=True),
)
"""Of stance, from heel strike to toe off, unless of the stride."""
LANDING_PEAKS = (
    Peak("knee extension moment, internal, landing", "knee_flexion_joint_moment", -1.0, (0.0, 1.0)),
    Peak("knee adduction moment, external, landing", "knee_adduction_joint_moment", -1.0, (0.0, 1.0)),
    Peak("knee abduction moment, external, landing", "knee_adduction_joint_moment", 1.0, (0.0, 1.0)),
    Peak("hip extension moment, internal, landing", "hip_flexion_joint_moment", -1.0, (0.0, 1.0)),
    Peak("ankle plantarflexion moment, internal, landing", "ankle_flexion_joint_moment", -1.0, (0.0, 1.0)),
)
"""From foot contact until the pelvis is lowest."""


def peak_columns(curves: Sequence[CycleCurve]) -> dict[str, Any]:
    """Return columns of all peaks, by name: trial, task, phase, side, stride, peak, unit, value, sd, percent.

    Values are positive in the direction that the name states. A peak whose phase is not all known is NaN. `percent` is
    where in the stride, stance or landing it is; NaN for impulses, whose SD is that of errors that last through stance.

    Args:
        curves: of the estimate, of all trials.
    """
    rows = []
    for peak in (*PEAKS, *LANDING_PEAKS):
        for one in curves:
            if one.quantity == peak.quantity and (one.stride.phase == "landing") == (peak in LANDING_PEAKS):
                value, sd, percent = _read(peak, one)
                unit = f"{UNITS[one.kind]} s".replace("/kg s", " s/kg") if peak.impulse else UNITS[one.kind]
                place = (one.trial, one.task, one.stride.phase, one.stride.side, one.stride.number)
                rows.append((*place, peak.name, unit, value, sd, percent))
    rows.sort(key=lambda row: (row[0], row[2] != "stride", row[3] != "r", row[4]))
    names = ("trial", "task", "phase", "side", "stride", "peak", "unit", "value", "sd", "percent")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _phase(peak: Peak, curve: CycleCurve) -> np.ndarray:
    """Return the mask (101,) of the phase; nothing without a toe off, nor of a stride where there is none."""
    if peak.of_stride and curve.stride.phase != "stride":
        return np.zeros(len(PERCENT), dtype=bool)
    whole = 100.0 if peak.of_stride else curve.stride.percent(curve.stride.toe_off_s)
    if not np.isfinite(whole):
        return np.zeros(len(PERCENT), dtype=bool)
    first, last = peak.phase
    return np.asarray((whole * first <= PERCENT) & (whole * last >= PERCENT))


def _read(peak: Peak, curve: CycleCurve) -> tuple[float, float, float]:
    """Return value, SD and percent; NaN unless all of the phase is known."""
    phase = _phase(peak, curve)
    if not (phase.any() and np.isfinite(curve.value[phase]).all()):
        return np.nan, np.nan, np.nan
    along, sd = peak.sign * curve.value[phase], curve.sd[phase]
    if peak.impulse:
        step_s = (curve.stride.end_s - curve.stride.start_s) / (len(PERCENT) - 1)
        counted = along > 0.0
        return float(along[counted].sum() * step_s), float(sd[counted].sum() * step_s), float("nan")
    at = int(np.argmax(along))
    return float(along[at]), float(sd[at]), float(PERCENT[phase][at])
