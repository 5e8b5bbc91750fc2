"""Computes speed, cadence, lengths and times of strides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from kinertia.motion.gait_cycle import FeetUnderPelvis, Stride
from kinertia.trial.data import FEET
from kinertia.trial.file_contents import Belt

_TOES_STAND = (0.3, 0.5)
"""Part of stance in which the toes are on the ground and not leaving it yet, in walking and running. The heel of a
runner rises before."""
_USUAL_STANCE = 0.6
"""Share of a stride that is stance, if toe off was not found."""
_BELT_M_S = 0.2
"""A foot in stance slides by less than this; a belt is faster."""


@dataclass(frozen=True)
class Spatiotemporal:
    """Spatiotemporal parameters of one stride; NaN if an event that they need was not found.

    Attributes:
        stride_time_s: from heel strike to heel strike.
        speed_m_s: stride length over stride time.
        cadence_steps_min: 120 over stride time.
        stride_length_m: distance of the heel from heel strike to heel strike; on a treadmill relative to the belt.
        step_length_m: from where the other heel landed to where this one lands at the end of the stride, along the
            stride; on a treadmill relative to the belt. The steps of both sides add up to the stride.
        step_time_s: from the other foot's heel strike to the end of the stride.
        step_width_m: between these positions, across the stride.
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


MEASURES = tuple(field.name for field in fields(Spatiotemporal))


def spatiotemporal(
    feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None = None
) -> tuple[Spatiotemporal, ...]:
    """Compute the spatiotemporal parameters of each of these strides."""
    ground = _Ground.of(feet, strides, belt)
    return tuple(_measures(feet, ground, stride) for stride in strides)


def travelled(feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None = None) -> np.ndarray:
    """Return the horizontal displacement (k, 3) m of each stride; on a treadmill relative to the belt.

    The belt's direction, and its speed unless stated, come from feet in stance.
    """
    ground = _Ground.of(feet, strides, belt)
    return np.array([_path(feet, ground, stride) for stride in strides]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class _Ground:
    """A floor, or the belts of a treadmill.

    Attributes:
        velocity: per side (3,) m/s, of feet in stance; zero on a floor.
        belt: the belt if its speed is stated, else None.
    """

    velocity: Mapping[str, np.ndarray]
    belt: Belt | None

    @classmethod
    def of(cls, feet: FeetUnderPelvis, strides: Sequence[Stride], belt: Belt | None) -> Self:
        """Determine the velocity of the ground from feet in stance."""
        return cls(_belt_velocities(feet, strides), belt)

    def displacement(self, side: str, start_s: float, end_s: float) -> np.ndarray:
        """Return the displacement (3,) m of a foot in stance with the ground."""
        velocity = self.velocity[side]
        if self.belt is None:
            return velocity * (end_s - start_s)
        along = velocity / max(float(np.linalg.norm(velocity)), 1e-9)
        return along * self.belt.under(FEET.index(side)).distance_m(start_s, end_s)


def _path(feet: FeetUnderPelvis, ground: _Ground, stride: Stride) -> np.ndarray:
    start, end = (_at(feet, feet.heel[stride.side], time) for time in (stride.start_s, stride.end_s))
    return np.asarray((end - start - ground.displacement(stride.side, stride.start_s, stride.end_s)) * [1.0, 0.0, 1.0])


def _measures(feet: FeetUnderPelvis, ground: _Ground, stride: Stride) -> Spatiotemporal:
    other = "l" if stride.side == "r" else "r"
    path = _path(feet, ground, stride)
    lasted, length = stride.end_s - stride.start_s, float(np.linalg.norm(path))
    heading = path / max(length, 1e-9)
    rightward = np.array([-heading[2], 0.0, heading[0]])
    landed = _at(feet, feet.heel[other], stride.opposite_strike_s)
    step = _at(feet, feet.heel[stride.side], stride.end_s) - landed
    step -= ground.displacement(other, stride.opposite_strike_s, stride.end_s)
    width = float(step @ rightward)
    return Spatiotemporal(
        stride_time_s=lasted,
        speed_m_s=length / lasted,
        cadence_steps_min=120.0 / lasted,
        stride_length_m=length,
        step_length_m=float(step @ heading),
        step_time_s=stride.end_s - stride.opposite_strike_s,
        step_width_m=width if stride.side == "r" else -width,
        stance_percent=stride.percent(stride.toe_off_s),
        double_support_percent=_double_support(stride),
    )


def _double_support(stride: Stride) -> float:
    """Return the % of the cycle with both feet on the ground, at its beginning and before toe off."""
    if stride.toe_off_s <= stride.opposite_strike_s:
        return 0.0
    first = stride.opposite_toe_off_s - stride.start_s
    return 100.0 * (first + stride.toe_off_s - stride.opposite_strike_s) / (stride.end_s - stride.start_s)


def _at(feet: FeetUnderPelvis, values: np.ndarray, time_s: float) -> np.ndarray:
    """Interpolate values (n, 3) at this time (3,)."""
    return np.array([np.interp(time_s, feet.time, column) for column in values.T])


def _belt_velocities(feet: FeetUnderPelvis, strides: Sequence[Stride]) -> dict[str, np.ndarray]:
    """Return the velocity by side: of both feet together, unless they are on belts of different speeds."""
    by_side = {side: _belt_velocity(feet, [stride for stride in strides if stride.side == side]) for side in FEET}
    moving = all(velocity.any() for velocity in by_side.values())
    apart = np.linalg.norm(by_side["r"] - by_side["l"]) > _BELT_M_S
    return by_side if moving and apart else dict.fromkeys(FEET, _belt_velocity(feet, strides))


def _belt_velocity(feet: FeetUnderPelvis, strides: Sequence[Stride]) -> np.ndarray:
    """Return the horizontal velocity (3,) m/s of the toes in stance; zero on a floor."""
    velocities = []
    for stride in strides:
        stance = stride.toe_off_s - stride.start_s
        if np.isnan(stance):
            stance = _USUAL_STANCE * (stride.end_s - stride.start_s)
        first, last = (stride.start_s + share * stance for share in _TOES_STAND)
        toe = feet.toe[stride.side]
        velocities.append((_at(feet, toe, last) - _at(feet, toe, first)) / (last - first))
    velocity = np.median(velocities, axis=0) * [1.0, 0.0, 1.0] if velocities else np.zeros(3)
    return velocity if np.linalg.norm(velocity) > _BELT_M_S else np.zeros(3)
