"""Speed, cadence, lengths and times of strides: what gait reports have in their first table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.motion.gait_cycle import FeetUnderPelvis, Stride
from kinertia.trial.belt import Belt
from kinertia.trial.data import FEET

_FOOT_FLAT = (10.0, 30.0)
"""% of the cycle in which the foot lies flat on the ground, until the heel rises."""
_BELT_M_S = 0.2
"""A standing foot slides by less than this; a belt is faster."""


@dataclass(frozen=True)
class Spatiotemporal:
    """Measures of one stride; NaN where an event that they need was not found.

    Attributes:
        stride_time_s: from heel strike to heel strike.
        speed_m_s: stride length over stride time.
        cadence_steps_min: 120 over stride time.
        stride_length_m: of the heel from heel strike to heel strike; on a treadmill against the belt.
        step_length_m: heel ahead of the other heel at the heel strike that ends the stride, along the stride.
        step_time_s: from the other foot's heel strike to that one.
        step_width_m: between the heels then, across the stride.
        stance_percent: of the cycle, until toe off.
        double_support_percent: of the cycle, both feet on the ground; 0 in running.

    Examples:
        >>> fit.spatiotemporal[["side", "cadence_steps_min"]].columns.tolist()
        ['side', 'cadence_steps_min']
    """

    stride_time_s: float
    speed_m_s: float
    cadence_steps_min: float
    stride_length_m: float
    step_length_m: float
    step_time_s: float
    step_width_m: float
    stance_percent: float
    double_support_percent: float


def spatiotemporal(
    feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None = None
) -> tuple[Spatiotemporal, ...]:
    """The measures of each of these strides."""
    return tuple(_measures(feet, *pair) for pair in zip(strides, travelled(feet, strides, belt), strict=True))


def travelled(feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None = None) -> np.ndarray:
    """(k, 3) m, horizontal: from heel strike to heel strike of each stride, on a treadmill against the belt.

    Standing feet tell its speed where it is not stated, and always its direction.
    """
    by_side = _belt_velocities(feet, strides)
    paths = []
    for stride in strides:
        by_feet = by_side[stride.side]
        start, end = (_at(feet, feet.heel[stride.side], time) for time in (stride.start_s, stride.end_s))
        under = by_feet * (stride.end_s - stride.start_s)
        if belt is not None:
            along = by_feet / max(float(np.linalg.norm(by_feet)), 1e-9)
            under = along * belt.under(FEET.index(stride.side)).way_m(stride.start_s, stride.end_s)
        paths.append((end - start - under) * [1.0, 0.0, 1.0])
    return np.array(paths).reshape(-1, 3)


def _measures(feet: FeetUnderPelvis, stride: Stride, path: np.ndarray) -> Spatiotemporal:
    other = "l" if stride.side == "r" else "r"
    lasted, length = stride.end_s - stride.start_s, float(np.linalg.norm(path))
    heading = path / max(length, 1e-9)
    rightward = np.array([-heading[2], 0.0, heading[0]])
    own, others = (_at(feet, feet.heel[side], stride.end_s) for side in (stride.side, other))
    width = float((own - others) @ rightward)
    return Spatiotemporal(
        stride_time_s=lasted,
        speed_m_s=length / lasted,
        cadence_steps_min=120.0 / lasted,
        stride_length_m=length,
        step_length_m=float((own - others) @ heading),
        step_time_s=stride.end_s - stride.opposite_strike_s,
        step_width_m=width if stride.side == "r" else -width,
        stance_percent=stride.percent(stride.toe_off_s),
        double_support_percent=_double_support(stride),
    )


def _double_support(stride: Stride) -> float:
    """% of the cycle with both feet on the ground, at its beginning and before toe off."""
    if stride.toe_off_s <= stride.opposite_strike_s:
        return 0.0
    first = stride.opposite_toe_off_s - stride.start_s
    return 100.0 * (first + stride.toe_off_s - stride.opposite_strike_s) / (stride.end_s - stride.start_s)


def _at(feet: FeetUnderPelvis, values: np.ndarray, time_s: float) -> np.ndarray:
    """(3,) values (n, 3) at this time."""
    return np.array([np.interp(time_s, feet.time, column) for column in values.T])


def _belt_velocities(feet: FeetUnderPelvis, strides: Sequence[Stride]) -> dict[str, np.ndarray]:
    """By side: of both feet together, unless they stand on belts of different speeds."""
    own = {side: _belt_velocity(feet, [one for one in strides if one.side == side]) for side in FEET}
    moving = all(velocity.any() for velocity in own.values())
    apart = np.linalg.norm(own["r"] - own["l"]) > _BELT_M_S
    return own if moving and apart else dict.fromkeys(FEET, _belt_velocity(feet, strides))


def _belt_velocity(feet: FeetUnderPelvis, strides: Sequence[Stride]) -> np.ndarray:
    """(3,) m/s, horizontal: how fast standing feet go; zero on a floor."""
    velocities = []
    for stride in strides:
        first, last = (stride.start_s + share / 100 * (stride.end_s - stride.start_s) for share in _FOOT_FLAT)
        heel = feet.heel[stride.side]
        velocities.append((_at(feet, heel, last) - _at(feet, heel, first)) / (last - first))
    velocity = np.median(velocities, axis=0) * [1.0, 0.0, 1.0] if velocities else np.zeros(3)
    return velocity if np.linalg.norm(velocity) > _BELT_M_S else np.zeros(3)
