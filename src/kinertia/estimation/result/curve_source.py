"""Evaluates the curves of a fitted trial at any time, wherever they are known; NaN elsewhere."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal, Self, TypeAlias

import numpy as np
from scipy.interpolate import make_interp_spline

from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.motion.ground_reactions import measured_reactions
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.smoothing import equal_columns, interpolate
from kinertia.trial.sampled_data import nearest_samples, runs, within

Stage = Literal["estimate", "literature"]
"""As estimated; or conventional: smoothed inverse kinematics, and inverse dynamics with the parameters before the
estimate."""
_Curve: TypeAlias = Callable[[np.ndarray], np.ndarray]
_FEWEST = 2
"""Frames of a run that a curve is drawn through."""
_QUINTIC = 6
"""Frames that a natural quintic spline needs."""


class CurveSource:
    """Quantities of a trial at any time; NaN where they are not known."""

    def __init__(self, trial: TrialFit, stage: Stage) -> None:
        self.kinematics, self.stage, curves = trial.kinematics, stage, trial.joint_curves
        k = trial.kinematics
        time, inner = k.trajectory_time, k.frames - k.trajectory_frames.start
        self.reactions = trial.reactions.whole if stage == "estimate" else measured_reactions(k)
        deviations = trial.deviations if stage == "estimate" else None
        if curves is None:
            q, loads = (_spread(len(time), inner, samples) for samples in (trial.motion.q, trial.joint_loads[stage]))
            legs = np.repeat(k.inside(time)[:, None], 2, axis=1)
            spread = None if deviations is None else deviations.spread_over(inner, len(time))
            joints = np.empty((len(time), 0, 3))
        else:
            shown = np.logical_or.reduce(curves.known, axis=1, keepdims=True)
            q, loads = np.where(shown, curves.motion.q, np.nan), curves.forces[stage]
            legs = k.trial.known_legs[k.trajectory_frames] & shown
            spread = None if deviations is None else curves.deviations
            joints = curves.joints[stage].moments if stage in curves.joints else np.empty((len(time), 0, 3))
        self._time, self._angles, self._loads, self._joints = time, q, loads, joints
        self._legs, self._spread = np.where(legs, 1.0, np.nan), spread

    # curves are made when they are first asked for: draws of a fit ask for few of them
    @cached_property
    def _angle(self) -> "Gapped":
        return Gapped.of(self._time, self._angles, partial(through_angles, derivative=0))

    @cached_property
    def _speed(self) -> "Gapped":
        return Gapped.of(self._time, self._angles, partial(through_angles, derivative=1))

    @cached_property
    def _load(self) -> "Gapped":
        return Gapped.of(self._time, self._loads, through_loads)

    @cached_property
    def _joint(self) -> "Gapped":
        return Gapped.of(self._time, self._joints, through_loads)

    @cached_property
    def _known_leg(self) -> "Gapped":
        return Gapped.of(self._time, self._legs, _linear)

    @cached_property
    def _deviation(self) -> "list[Gapped]":
        return [] if self._spread is None else [Gapped.of(self._time, curve, _linear) for curve in self._spread.curves]

    def angle(self, time: np.ndarray) -> np.ndarray:
        """Return coordinates (n, c); those of IK + ID wherever inverse kinematics determined them."""
        return self._angle(time) if self.stage == "estimate" else tracked(self.kinematics, time, 0)

    def speed(self, time: np.ndarray) -> np.ndarray:
        """Return derivatives (n, c) of the coordinates."""
        return self._speed(time) if self.stage == "estimate" else tracked(self.kinematics, time, 1)

    def moment(self, time: np.ndarray) -> np.ndarray:
        """Return joint loads (n, c)."""
        return self._load(time)

    def joint_moment(self, time: np.ndarray) -> np.ndarray:
        """Return three-dimensional joint moments (n, j, 3), N m."""
        return self._joint(time)

    def deviations(self, time: np.ndarray) -> CurveDeviations:
        """Return standard deviations of all curves; NaN if there are none."""
        if self._spread is None:
            none = CurveDeviations.filled(0, self._angles.shape[1], self._joints.shape[1], np.nan)
            return none.spread_over(np.zeros(0, dtype=int), len(time))
        return CurveDeviations(*(deviation(time) for deviation in self._deviation))

    def force(self, time: np.ndarray) -> np.ndarray:
        """Return the ground reaction force (n, 2, 3) N on right and left foot."""
        known, samples = self._known_leg(time), self.reactions.time
        forces = self.reactions.at(np.clip(time, samples[0], samples[-1]))[..., :3]
        return np.where(np.isfinite(known)[..., None], forces, np.nan)


@dataclass(frozen=True, eq=False)
class Gapped:
    """Curves with gaps.

    Attributes:
        shape: of the values at one time.
        parts: columns (of the first axis of `shape`) that are known together, first and last time of a run in which
            they are, and the curve through it.
    """

    shape: tuple[int, ...]
    parts: tuple[tuple[np.ndarray, float, float, _Curve], ...]

    @classmethod
    def of(cls, time: np.ndarray, values: np.ndarray, through: Callable[[np.ndarray, np.ndarray], _Curve]) -> Self:
        """Make curves through the runs of values (f, c, ...) that are not NaN, at times (f,)."""
        known = np.isfinite(values).all(axis=tuple(range(2, values.ndim)))
        parts: list[tuple[np.ndarray, float, float, _Curve]] = []
        if not known.size:
            return cls(values.shape[1:], ())
        for mask, columns in equal_columns(known):
            for first, last in runs(mask):
                inside = slice(first, last + 1)
                if last - first + 1 >= _FEWEST:
                    curve = through(time[inside], values[inside][:, columns])
                    parts.append((columns, float(time[first]), float(time[last]), curve))
        return cls(values.shape[1:], tuple(parts))

    def __call__(self, time: np.ndarray) -> np.ndarray:
        """Return the values (n, ...) at these times; NaN in gaps."""
        result = np.full((len(time), *self.shape), np.nan)
        for columns, first, last, curve in self.parts:
            here = np.flatnonzero(within(time, first, last))
            if len(here):
                result[here[:, None], columns] = curve(np.clip(time[here], first, last))
        return result


def tracked(kinematics: Kinematics, time: np.ndarray, derivative: int) -> np.ndarray:
    """Return coordinates (n, c) of smoothed inverse kinematics, or their derivatives; NaN where there are none."""
    ik, spline = kinematics.ik, kinematics.spline
    inside = (time >= spline.time[0]) & (time <= spline.time[-1])
    known = inside[:, None] & np.isfinite(ik.q[nearest_samples(ik.time, time)])
    return np.where(known, spline(np.clip(time, spline.time[0], spline.time[-1]), derivative), np.nan)


def through_angles(time: np.ndarray, q: np.ndarray, derivative: int) -> _Curve:
    """Return a derivative of the spline through coordinates as OpenSim's tools make it."""
    if len(time) >= _QUINTIC:
        return partial(interpolate(time, q), derivative=derivative)
    curve: _Curve = make_interp_spline(time, q, k=1).derivative(derivative)
    return curve


def _through(time: np.ndarray, values: np.ndarray, degree: int) -> _Curve:
    """Return the spline of this degree, or less where there are few values."""
    curve: _Curve = make_interp_spline(time, values, k=min(degree, len(time) - 1))
    return curve


_linear, through_loads = partial(_through, degree=1), partial(_through, degree=3)


def _spread(count: int, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return `count` rows, these with the values and the others NaN."""
    result = np.full((count, *values.shape[1:]), np.nan)
    result[rows] = values
    return result
