"""Represents coordinates by uniform quintic B-splines, of the bandwidth selected for motion and forces.

The knot spacing of the motion's splines limits the bandwidth: they have no accelerations above it. The required
bandwidth follows from the ground reactions, whose sum is the body's mass times the acceleration of its centre of mass,
free of marker noise: the motion must leave no larger residual of this sum than rigid segments leave anyway. A slow walk
needs 10 Hz, a brisk one 12, impacts more than markers can resolve. Each trial of a session has its own bandwidth: at
that of a brisk walk, the accelerations of a slow one would be noise. For trials synthesised with OpenSim from walks at
1.3 m/s, hip moments err by 2.0 N m with 10 Hz, 1.7 with 12, 1.8 with 15, 2.9 with 20; body segment parameters do not
depend on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array

from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import equal_columns
from kinertia.settings import ForceCutoff

_DEGREE = 5
_ACTIVE = _DEGREE + 1
_STRAIGHT = 1e-8
"""Weight of the squared second differences of the coefficients: what frames hardly determine continues its neighbours
in a straight line, wherever the origin is."""
_SECOND_DIFFERENCE = (1.0, -2.0, 1.0)
_ROUNDING = 1e-9
"""Tolerance relative to a knot interval and to a trial: rounding of the times must not add a knot."""
STEADY_INTERVALS = 0.5
"""In four people's walks by OpenSim, cut at both ends, 97 % of moments this near the ends are within 95 % intervals."""
LADDER_HZ = (10.0, 12.0, 15.0)
LEFT_SHARE_OF_WEIGHT = 0.005
"""Largest RMS residual of the ground reactions that the motion may leave, as a share of their mean vertical force."""
_FRAMES_PER_CYCLE = 5.0
"""Frames per cycle that markers need: they resolve nothing faster than the frame rate over this."""


class MotionBasis:
    """Uniform quintic B-splines over a trial's time, with knots no closer than every second frame.

    The first knot is at the first frame, or a `phase` of a knot interval (0 to 1) before it; there are as many. If only
    a part of the trial is to begin and end at knots, those beyond it follow at the same distance: what is added around
    the measured windows does not move the knots within.

    Six splines are active at any time, and seven at a frame and the two after it.

    Attributes:
        size: number of splines.
        intervals: number of knot intervals.
        first: (n,) the first active spline of each frame.
        values: (3, n, 6) values of the active splines and their first two time derivatives.
    """

    def __init__(self, time: np.ndarray, spacing_s: float, phase: float = 0.0, part: slice = slice(None)) -> None:
        window_time = time[part]
        length = window_time[-1] - window_time[0]
        count = min(max(1, int(np.ceil(length / spacing_s * (1.0 - _ROUNDING)))), (len(window_time) - 1) // 2)
        before, after = (
            int(np.ceil(more / length * count - _ROUNDING))
            for more in (window_time[0] - time[0], time[-1] - window_time[-1])
        )
        step = length / (count - phase)
        begin = window_time[0] - (before + phase) * step
        count += before + after
        knots = begin + step * np.arange(-_DEGREE, count + _ACTIVE)
        self.intervals = count
        self.size = count + _DEGREE
        place = (time - begin) / step
        self.first = np.minimum((place + _ROUNDING).astype(int), count - 1)
        # on a uniform grid all splines are shifted copies of one
        shape = BSpline.basis_element(np.arange(_ACTIVE + 1.0))
        local = place - self.first
        at = local[:, None] + np.arange(_DEGREE, -1, -1)
        self.values = np.stack([shape.derivative(d)(at) / step**d if d else shape(at) for d in range(3)])
        self.active = self.first[:, None] + np.arange(_ACTIVE)
        self.knots = knots
        self._steady = np.arange(len(time))
        for near, innermost in ((place - place[0] < STEADY_INTERVALS, -1), (place[-1] - place < STEADY_INTERVALS, 0)):
            self._steady[near] = np.flatnonzero(near)[innermost]

    @cached_property
    def steady_values(self) -> np.ndarray:
        """`values`, but with the accelerations constant in the last half of a knot interval at either end.

        So are those of the motion in results, nearly (`Kinematics.with_smooth_ends`). A knot there ends the constancy.
        """
        result, alike = self.values.copy(), self.first[self._steady] == self.first
        result[2, alike] = self.values[2, self._steady[alike]]
        return result

    def evaluate(
        self, coefficients: np.ndarray, frames: slice | np.ndarray = slice(None), derivatives: int = 2
    ) -> list[np.ndarray]:
        """Evaluate coordinates and their first derivatives, each (n, c), from coefficients (size, c)."""
        active = coefficients[self.active[frames]]
        return [np.einsum("na,nac->nc", values[frames], active) for values in self.values[: 1 + derivatives]]

    def evaluate_steady(self, coefficients: np.ndarray, frames: slice | np.ndarray = slice(None)) -> list[np.ndarray]:
        """Evaluate as `evaluate`, with the accelerations constant in the last half of a knot interval at either end."""
        accelerations = self.evaluate(coefficients, self._steady[frames])[2]
        return [*self.evaluate(coefficients, frames, 1), accelerations]

    def fit(self, q: np.ndarray) -> np.ndarray:
        """Fit coefficients (size, c) to q (n, c) by least squares; NaN rows of a column are left out.

        A column without any other row has coefficients of zero.
        """
        seen = np.isfinite(q)
        filled = np.where(seen, q, 0.0)
        coefficients = np.empty((self.size, q.shape[1]))
        for mask, columns in equal_columns(seen):
            if mask.sum() < 2:
                coefficients[:, columns] = filled[:, columns].sum(axis=0)
                continue
            value = self.values[0] * mask[:, None]
            band = np.zeros((_ACTIVE, self.size))
            for a in range(_ACTIVE):
                for b in range(a, _ACTIVE):
                    band[b - a] += np.bincount(self.active[:, a], value[:, a] * value[:, b], self.size)
            rows = np.arange(0, value.size + 1, _ACTIVE)
            every = csr_array((value.ravel(), self.active.ravel(), rows), (len(value), self.size))
            rhs = every.T @ filled[:, columns]
            for a, first in enumerate(_SECOND_DIFFERENCE):
                for b, second in enumerate(_SECOND_DIFFERENCE[a:]):
                    band[b, a : self.size - 2 + a] += _STRAIGHT * first * second
            coefficients[:, columns] = solveh_banded(band, rhs, lower=True)
        return coefficients


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidths of a trial's motion and forces.

    Attributes:
        motion_hz: half the knot rate of its splines, and low-pass cutoff of the forces in the root equations.
        force: bandwidth of the forces in joint moments.
    """

    motion_hz: float
    force: ForceCutoff = "auto"

    @property
    def spacing_s(self) -> float:
        """Knot spacing of the splines, s."""
        return 1.0 / (2.0 * self.motion_hz)

    @classmethod
    def of(
        cls, trials: Sequence[Kinematics], cutoff_hz: float | Literal["gcv"] = "gcv", force: ForceCutoff = "auto"
    ) -> tuple[Self, ...]:
        """Select the bandwidth that each of these trials needs, unless the user set one for all.

        Args:
            trials: of one estimate.
            cutoff_hz, force: as in `Settings`.
        """
        if not isinstance(cutoff_hz, str):
            return (cls(cutoff_hz, force),) * len(trials)
        return tuple(cls(_needed_hz(kinematics), force) for kinematics in trials)


def _needed_hz(kinematics: Kinematics) -> float:
    """Return the narrowest bandwidth (Hz) that leaves little residual force and that the markers can resolve."""
    loads = kinematics.trial.loads
    inside = kinematics.inside(loads.time)
    force = loads.force[inside].sum(axis=1)
    limit = LEFT_SHARE_OF_WEIGHT * force[:, 1].mean()
    most = kinematics.trial.markers.rate_hz / _FRAMES_PER_CYCLE
    steps = [step for step in LADDER_HZ if step <= most] or [LADDER_HZ[0]]
    for cutoff_hz in steps:
        smoothed = kinematics.smoothed_loads(cutoff_hz)(loads.time[inside]).reshape(-1, 2, 6)[..., :3].sum(axis=1)
        if np.sqrt(np.square(force - smoothed).sum(axis=1).mean()) <= limit:
            return cutoff_hz
    return steps[-1]
