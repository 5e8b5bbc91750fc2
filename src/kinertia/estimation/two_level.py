"""Implements the study's estimator: pelvis correction (inner level), body segment parameters (outer level).

Inner level: equation (2) of `kinertia.motion.dynamics` gives the pelvis acceleration without residual at the measured
state. It is integrated twice by the trapezoid rule, with the two constants per coordinate that track the measured
pelvis best (linear least squares, closed form). Outer level: bounded nonlinear least squares on the residual P at the
corrected motion, over all frames of all trials.

Deviations from the study: CoM coordinates are bounded to 1 m (with a mass near zero the CoM would be undetermined); no
finite differences (the derivative is chained through (2), the integration and the fit), and moments are divided by the
body's radius of gyration about the pelvis, so that N and N m can be summed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from kinertia.estimation.identifiability import ParameterVector
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, consistent_root_acceleration, residual, root_derivatives, root_regressor
from kinertia.motion.workload import one_blas_thread
from kinertia.trial.sampled_data import span_s

LONGEST_INTERVAL_S = 1.1
"""Longest integration interval, over which the pelvis is corrected by one double integration."""
_FREE_EVALUATIONS, _MAX_EVALUATIONS = 200, 400
_EXACT = 1e-20
"""Share of the initial cost below which a cost is a rounding error."""
_SMALLEST_POSITIVE, _FARTHEST_COM_M = 1e-9, 1.0
"""Bounds: masses and moments stay positive (kg, kg m2), each CoM coordinate within 1 m of the segment's origin."""
_SMALLEST_SCALE = 0.005
"""Trust region: each parameter in units of its start value, but not below this (kg, m, kg m2)."""


@dataclass(frozen=True)
class Window:
    """A measured window of a trial, in which all ground contact is measured.

    Attributes:
        time: (n,) s, uniform.
        motion: smoothed coordinates and derivatives.
        wrench: (n, 6) sum over both feet: force (N), moment about the ground origin (N m), ground axes.
    """

    time: np.ndarray
    motion: Motion
    wrench: np.ndarray

    @cached_property
    def integration(self) -> Integration:
        """Double integration on this window's time base."""
        return Integration(self.time)


def intervals(window: Window) -> list[Window]:
    """Divide the window into equal integration intervals of at most LONGEST_INTERVAL_S, about a stride.

    With two constants per coordinate the corrected pelvis stays near the measured one only for so long: literature BSPs
    leave errors of some 10 N m, which rotates the pelvis by 0.3 rad within 2.4 s. The study's trials were one stride.
    """
    count = int(np.ceil(span_s(window.time) / LONGEST_INTERVAL_S * (1.0 - 1e-9)))
    edges = np.linspace(0, len(window.time), max(count, 1) + 1).round().astype(int)
    parts = [slice(start, end) for start, end in pairwise(edges)]
    return [Window(window.time[part], window.motion.cut(part), window.wrench[part]) for part in parts]


class Integration:
    """Trapezoid integration, twice, with the constants that track a given trajectory best.

    Linear: position = I2 a + line, velocity = I1 a + slope, with the line fitted to (measured - I2 a).
    """

    def __init__(self, time: np.ndarray) -> None:
        self._step = np.diff(time)[:, None]
        t = time - time.mean()
        self._line = np.column_stack([np.ones_like(t), t])
        self._fit = np.linalg.pinv(self._line)

    def _once(self, rate: np.ndarray) -> np.ndarray:
        flat = rate.reshape(len(rate), -1)
        total = np.zeros_like(flat)
        np.cumsum((flat[:-1] + flat[1:]) / 2 * self._step, axis=0, out=total[1:])
        return total.reshape(rate.shape)

    def track(self, acceleration: np.ndarray, measured: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity (n, ...) with this acceleration, nearest to the measured position.

        With `measured` zero it is the derivative of the result with respect to anything that changes the acceleration.
        """
        velocity = self._once(acceleration)
        position = self._once(velocity)
        gap = (measured - position).reshape(len(position), -1)
        constants = self._fit @ gap
        position = position + (self._line @ constants).reshape(position.shape)
        return position, velocity + constants[1].reshape(velocity.shape[1:])


@dataclass(frozen=True)
class TwoLevelResult:
    """Result of `estimate_two_level`.

    Attributes:
        bsp: the estimate.
        motions: per window, the corresponding motion (corrected, if correction was requested).
        residuals: per window, (n, 6) root residual.
        cost: half the sum of squared, scaled residuals at start and end.
        evaluations: number of evaluations of the residual.
        converged: False if the iteration stopped at its limit.
    """

    bsp: BodySegmentParameters
    motions: tuple[Motion, ...]
    residuals: tuple[np.ndarray, ...]
    cost: tuple[float, float]
    evaluations: int
    converged: bool


def correct_pelvis(skeleton: Skeleton, bsp: BodySegmentParameters, window: Window) -> Motion:
    """Return, as the inner level, the motion with the pelvis acceleration of equation (2) nearest to the measured."""
    acceleration, _ = consistent_root_acceleration(skeleton, bsp, window.motion, window.wrench)
    position, velocity = window.integration.track(acceleration, window.motion.q[:, :6])
    return window.motion.with_root(position, velocity, acceleration)


@one_blas_thread
def estimate_two_level(
    skeleton: Skeleton,
    start: BodySegmentParameters,
    windows: Sequence[Window],
    *,
    symmetric: bool = True,
    correct: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> TwoLevelResult:
    """Find, as the outer level, the BSPs that minimise the residual P over all frames of all windows.

    Args:
        skeleton: the model.
        start: initial BSPs; their products of inertia are kept (zero in the study).
        windows: measured windows of one or more trials of this person.
        symmetric: 49 parameters, left mirroring right, instead of 84.
        correct: with pelvis correction (equation 3) or without (equation 1 at the measured motion).
        progress: called with the share of the evaluations' limit that has been used.
    """
    vector = ParameterVector(start, symmetric)
    length = radius_of_gyration(skeleton, start, windows)
    problem = TwoLevelProblem(skeleton, vector, windows, correct, length)
    theta = vector.values(start)
    begin = 0.5 * float(np.square(problem.residuals(theta)).sum())
    fit = _minimise(problem, theta, vector_bounds(vector), _EXACT * begin, progress)
    bsp = vector.bsp(fit.x)
    motions = tuple(problem.motion(bsp, window) for window in windows)
    loads = tuple(residual(skeleton, bsp, m, w.wrench) for m, w in zip(motions, windows, strict=True))
    return TwoLevelResult(bsp, motions, loads, (begin, float(fit.cost)), int(fit.nfev), fit.status > 0)


def vector_bounds(vector: ParameterVector) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper bounds of theta: masses and moments positive, CoM coordinates within 1 m."""
    positive = vector.lower_bounds == 0.0
    return np.where(positive, _SMALLEST_POSITIVE, -_FARTHEST_COM_M), np.where(positive, np.inf, _FARTHEST_COM_M)


def trust_scale(theta: np.ndarray) -> np.ndarray:
    """Return the unit of each parameter in the trust region."""
    scale: np.ndarray = np.maximum(np.abs(theta), _SMALLEST_SCALE)
    return scale


def _minimise(
    problem: TwoLevelProblem,
    theta: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    exact: float,
    progress: Callable[[float], None],
) -> OptimizeResult:
    """Solve least squares within bounds; a cost below `exact` is a rounding error.

    Levenberg-Marquardt runs first without bounds: it crosses them on its way, and ends inside if the data are good.
    Otherwise the trust region method keeps to them from the start; it may end on a bound short of the minimum. If it
    creeps along a valley until its limit, Levenberg-Marquardt continues from there.
    """
    scale = trust_scale(theta)
    free = _minimise_freely(problem, theta, scale, bounds, exact)
    if free is not None:
        return free
    bounded = least_squares(
        problem.residuals,
        np.clip(theta, *bounds),
        problem.jacobian,
        bounds=bounds,
        x_scale=scale,
        xtol=1e-15,
        ftol=1e-6,
        gtol=1e-15,
        max_nfev=_MAX_EVALUATIONS,
        callback=lambda intermediate_result: progress(intermediate_result.nfev / _MAX_EVALUATIONS),
    )
    best = bounded
    if bounded.status == 0:
        free = _minimise_freely(problem, bounded.x, scale, bounds, exact)
        if free is not None and free.cost < bounded.cost:
            free.nfev += bounded.nfev
            best = free
    best.nfev += _FREE_EVALUATIONS
    return best


def _minimise_freely(
    problem: TwoLevelProblem,
    theta: np.ndarray,
    scale: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    exact: float,
) -> OptimizeResult | None:
    """Run Levenberg-Marquardt without bounds; None unless it converges inside them, or to a cost below `exact`."""
    with suppress(np.linalg.LinAlgError, ValueError), np.errstate(all="ignore"):
        free = least_squares(
            problem.residuals,
            theta,
            problem.jacobian,
            method="lm",
            x_scale=scale,
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=_FREE_EVALUATIONS,
        )
        # at the level of rounding the tolerances may never be met
        if free.status == 0 and free.cost < exact:
            free.status = 2
        if free.status > 0 and np.all((free.x > bounds[0]) & (free.x < bounds[1])):
            return free
    return None


def radius_of_gyration(skeleton: Skeleton, bsp: BodySegmentParameters, windows: Sequence[Window]) -> float:
    """Return the body's radius of gyration (m) about the pelvis in the first frame.

    Moments divided by it can be summed with forces.
    """
    first = windows[0]
    start = Motion(first.motion.q[:1], first.motion.qd[:1], first.motion.qdd[:1])
    _, (mass,) = consistent_root_acceleration(skeleton, bsp, start, first.wrench[:1])
    about_axes = skeleton.root.axes(start.q)[0].T @ mass[3:, 3:]
    return float(np.sqrt(np.trace(about_axes) / 3 / np.linalg.norm(mass[:3, 0])))


@dataclass(frozen=True)
class TwoLevelProblem:
    """Scaled residuals and their Jacobian with respect to the parameter vector."""

    skeleton: Skeleton
    vector: ParameterVector
    windows: Sequence[Window]
    correct: bool
    length: float

    @property
    def _scale(self) -> np.ndarray:
        return np.repeat([1.0, 1.0 / self.length], 3)

    def motion(self, bsp: BodySegmentParameters, window: Window) -> Motion:
        """Return the motion that corresponds to these BSPs: corrected, or as measured."""
        return correct_pelvis(self.skeleton, bsp, window) if self.correct else window.motion

    def residuals(self, theta: np.ndarray) -> np.ndarray:
        """Return scaled residuals of all frames of all windows, in one row."""
        bsp = self.vector.bsp(theta)
        parts = [residual(self.skeleton, bsp, self.motion(bsp, w), w.wrench) * self._scale for w in self.windows]
        return np.concatenate([part.ravel() for part in parts])

    def jacobian(self, theta: np.ndarray) -> np.ndarray:
        """Return the derivative of `residuals` with respect to theta."""
        bsp = self.vector.bsp(theta)
        change = self.vector.jacobian(theta)
        if self.correct:
            parts = [self._corrected_jacobian(bsp, change, window) for window in self.windows]
        else:
            parts = [regressor @ change for regressor in self._measured_regressors]
        return np.concatenate([(part * self._scale[:, None]).reshape(-1, len(theta)) for part in parts])

    @cached_property
    def _measured_regressors(self) -> list[np.ndarray]:
        segments = self.vector.reference.segments
        return [root_regressor(self.skeleton, segments, window.motion) for window in self.windows]

    def _corrected_jacobian(self, bsp: BodySegmentParameters, change: np.ndarray, window: Window) -> np.ndarray:
        """Return dP / dtheta (n, 6, k): Y dphi plus the effect of the corrected pelvis motion."""
        acceleration, mass = consistent_root_acceleration(self.skeleton, bsp, window.motion, window.wrench)
        measured = window.motion
        balanced = measured.with_root(measured.q[:, :6], measured.qd[:, :6], acceleration)
        shown = root_regressor(self.skeleton, bsp.segments, balanced) @ change
        d_acceleration = -np.linalg.solve(mass, shown)
        d_position, d_velocity = window.integration.track(d_acceleration)
        position, velocity = window.integration.track(acceleration, measured.q[:, :6])
        moved = measured.with_root(position, velocity, acceleration)
        by = root_derivatives(self.skeleton, bsp, moved, window.wrench)
        direct = root_regressor(self.skeleton, bsp.segments, moved) @ change
        result: np.ndarray = direct + by.q @ d_position + by.qd @ d_velocity + by.qdd @ d_acceleration
        return result
