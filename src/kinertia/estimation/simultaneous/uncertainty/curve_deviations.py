"""Computes standard deviations over time of joint angles, moments, powers and ground reactions.

They combine the uncertainty of motion, body segment parameters and calibration by the delta method: analytic
derivatives by spline coefficients and static unknowns, times their posterior covariance. Errors that recur in every
stride (`marker_noise`) do not make the motion less certain, only what many frames show of static unknowns: the
residual uncertainty of the motion, given these, is due to the errors alone. It comes from the covariance of the
coefficients (`curve_variances`), and is scaled by the observed size of the errors (`motion_noise`), in moments by more
where skin motion is not observable (`model_errors`). The delay of the forces counts with its whole distribution
(`delayed_loads`): at foot contact they change within less than its uncertainty. The part of the forces that is faster
than the motion (`GroundReactions.impact`) is added as a moving mean square: whether it acts on the joints or
decelerates segments is unknown. So is what a filter may have taken from them (`GroundReactions.blurred`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.elimination import Branch, Eliminated
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import write_by_splines
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.uncertainty.curve_variances import EndSpread, MotionSpread, write_variances
from kinertia.estimation.simultaneous.uncertainty.model_errors import (
    block_growth,
    end_growth,
    fixed_axes,
    knee_geometry,
)
from kinertia.estimation.simultaneous.uncertainty.moment_derivatives import MomentDerivatives, MomentsOfTrial
from kinertia.motion.workload import side_by_side
from kinertia.trial.sampled_data import even_mean

_FRAMES_AT_ONCE = 100
"""Number of frames processed at once; larger arrays would exceed the processor's cache."""
_LOST_KNOTS = 2.0
"""Half of the averaging interval, in knot intervals: one period of the cutoff."""


@dataclass(frozen=True, eq=False)
class CurveDeviations:
    """Posterior standard deviations of a trial's curves at its d reported frames.

    Attributes:
        coordinates: (d, c) rad, m.
        moments: (d, c) of the joint moments, N m, and of the forces of translations, N.
        powers: (d, c) of joint moment times speed, W.
        ground_forces: (d, 2, 3) of the ground reactions on right and left foot, N: from the instrument corrections and
            the plates' own noise.
        joints: (d, j, 2, 3) of the moments (N m) and forces (N) of `joint_moments`.
    """

    coordinates: np.ndarray
    moments: np.ndarray
    powers: np.ndarray
    ground_forces: np.ndarray
    joints: np.ndarray

    def and_of(self, other: CurveDeviations) -> CurveDeviations:
        """Combine with other, independent standard deviations."""
        return CurveDeviations(*(np.hypot(*pair) for pair in zip(self.curves, other.curves, strict=True)))

    @property
    def curves(self) -> tuple[np.ndarray, ...]:
        """The standard deviations of all curves, in the order of the attributes."""
        return tuple(getattr(self, field.name) for field in fields(self))

    def roots(self) -> CurveDeviations:
        """Convert variances to standard deviations, in place."""
        for curve in self.curves:
            np.sqrt(np.maximum(curve, 0.0, out=curve), out=curve)
        return self

    @classmethod
    def filled(cls, d: int, c: int, j: int, value: float) -> CurveDeviations:
        """Return standard deviations of so many frames, coordinates and joints that all have this value."""
        return cls(*(np.full(shape, value) for shape in ((d, c), (d, c), (d, c), (d, 2, 3), (d, j, 2, 3))))

    def at(self, frames: slice | np.ndarray) -> CurveDeviations:
        """Return the standard deviations of these frames."""
        return CurveDeviations(*(curve[frames] for curve in self.curves))

    def of_motion_alone(self) -> CurveDeviations:
        """Return them without loads: errors of instruments that no root equation shows are not known to be small."""
        unknown = [np.full(curve.shape, np.nan) for curve in self.curves[1:]]
        return CurveDeviations(self.coordinates, *unknown)

    def spread_over(self, rows: np.ndarray, count: int) -> CurveDeviations:
        """Return the standard deviations of `count` frames, of which these (d,) are known; NaN in the others."""
        result = [np.full((count, *curve.shape[1:]), np.nan) for curve in self.curves]
        for into, curve in zip(result, self.curves, strict=True):
            into[rows] = curve
        return CurveDeviations(*result)


def curve_deviations(
    problem: MapProblem,
    k: int,
    coefficients: np.ndarray,
    static: np.ndarray,
    eliminated: Eliminated,
    root: np.ndarray,
    noise: np.ndarray,
) -> CurveDeviations:
    """Compute the posterior standard deviations of the curves of trial k.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients, static: the estimate.
        eliminated: the trial's normal equations there, undamped.
        root: (S, S + u) root of the posterior covariance of the static unknowns: u columns of their own
            (`marginal_posterior`), then those of `StaticInformation`, of which the rows of unknowns in the root
            equations, which come first, have only as many nonzero columns as there are such unknowns.
        noise: (3,) `motion_noise`, of errors that do not recur.
    """
    basis, frames, time = problem.bases[k], problem.trials[k].curve_frames, problem.trials[k].time
    delay_sd_s = float(np.linalg.norm(root[problem.loads.delay_unknowns(k)].sum(axis=0)))
    moments = MomentsOfTrial(problem, k, static, problem.loads.reactions(k, static), delay_sd_s)
    joints, (d, c) = moments.virtual.joints, (len(frames), coefficients.shape[1])
    curves = _Curves(
        moments,
        coefficients,
        np.sqrt(noise),
        frames,
        block_growth(problem, k, static, time[frames], joints) * end_growth(basis, time, time[frames])[:, None],
        CurveDeviations.filled(d, c, len(joints), 0.0),
        np.empty((d, c + 6 * len(joints))),
        np.empty((d, c)),
    )
    middle = EndSpread.of_middle(eliminated.middle, root)
    side_by_side(lambda branch: curves.add(branch, root, middle), eliminated.branches)
    variance, around = curves.variance, 1 + 2 * round(_LOST_KNOTS * len(basis.first) / (basis.size - 5))
    lost = even_mean(np.square(curves.uncertain), around)
    variance.moments[:] += lost[:, :c]
    variance.powers[:] += lost[:, :c] * np.square(curves.speed)
    curves.of_joints[:] += lost[:, c:].reshape(curves.of_joints.shape)
    return variance.roots()


@dataclass(frozen=True)
class _Curves:
    """The curves of a trial, whose variances are written branch by branch.

    Attributes:
        moments: the joint moments.
        coefficients: as in `curve_deviations`.
        shares: as in `_Seen`.
        frames: (d,) indices of the reported frames.
        grown: (d, r) factors on the corresponding standard deviations of the moments (`model_errors.block_growth`).
        variance: of the curves.
        uncertain: (d, r) as in `MomentDerivatives`.
        speed: (d, c) of the coordinates.
    """

    moments: MomentsOfTrial
    coefficients: np.ndarray
    shares: np.ndarray
    frames: np.ndarray
    grown: np.ndarray
    variance: CurveDeviations
    uncertain: np.ndarray
    speed: np.ndarray

    @property
    def of_joints(self) -> np.ndarray:
        """Variances (d, j, 2, 3) of the joints' moments and forces."""
        return self.variance.joints

    def add(self, branch: Branch, root: np.ndarray, end: EndSpread) -> None:
        """Write the variances in the frames of a branch, given the uncertainty of the block in which it ends."""
        if not len(self.frames):
            return
        first = self.moments.problem.bases[self.moments.k].first[self.frames]
        needed = slice(first[0], first[-1] + 6)
        for part, time_block in zip(branch.outwards(), reversed(branch.time_blocks), strict=True):
            found = MotionSpread.of(part, time_block, root, end, needed)
            if found is None:
                return
            spread, end = found
            begin, stop = np.searchsorted(self.frames, [time_block.frames.start, time_block.frames.stop])
            for start in range(begin, stop, _FRAMES_AT_ONCE):
                self._write(spread, root, slice(start, min(start + _FRAMES_AT_ONCE, stop)))

    def _write(self, spread: MotionSpread, root: np.ndarray, rows: slice) -> None:
        moments, problem, chosen = self.moments, self.moments.problem, self.frames[rows]
        basis, variance = problem.bases[moments.k], self.variance
        motion = problem.model.full(basis.evaluate_steady(self.coefficients, chosen), moments.static)
        every, c = moments.derivatives(motion, chosen), len(problem.moving)
        self.uncertain[rows], self.speed[rows] = every.uncertain, motion[1][:, problem.moving]
        by, values, in_root = every.rows(slice(0, c)), basis.steady_values[:, chosen], problem.layout.in_root
        known = root[in_root, : root.shape[1] - len(root) + in_root.stop]
        seen = _Seen(by, self.speed[rows], basis.first[chosen], values, self.shares, self.grown[rows, :c])
        _write_variances(spread, seen, known, variance, rows)
        joints = replace(seen, by=every.rows(slice(c, None)), grown=self.grown[rows, c:])
        variances = _joint_variances(spread, joints, known)
        variances += knee_geometry(moments.virtual.skeleton, moments.virtual.joints, joints.by.value)
        self.of_joints[rows] = variances.reshape(len(variances), *self.of_joints.shape[1:])
        ground = np.square(by.ground @ known[problem.layout.errors]).sum(axis=-1) + by.ground_delay_squares
        noise_n = moments.reactions.noise_n * (by.loads[..., :3] != 0.0)
        variance.ground_forces[rows] = ground.reshape(-1, 2, 3) + np.square(noise_n)
        tilts = problem.calibration.fixed_axes
        apart = (
            fixed_axes(problem.skeleton, moments.virtual.joints, joints.by.value, by.value, tilts) + by.delay_squares
        )
        variance.moments[rows] += apart
        variance.powers[rows] += apart * np.square(self.speed[rows])


@dataclass(frozen=True)
class _Seen:
    """Dependence of the curves on the unknowns in some frames.

    Attributes:
        by: derivatives of the moments (d, r).
        speed: (d, c) of the coordinates.
        first: (d,) the first active spline.
        values: (3, d, 6) of the active splines and their first two derivatives.
        shares: (3,) standard deviations of positions, rates and accelerations due to the markers' errors alone,
            relative to those that the estimate expects.
        grown: (d, r) as in `_Curves`.
    """

    by: MomentDerivatives
    speed: np.ndarray
    first: np.ndarray
    values: np.ndarray
    shares: np.ndarray
    grown: np.ndarray


class _Interval(NamedTuple):
    """Rows in the frames of one knot interval (`write_variances`).

    Attributes:
        frames: slice of the frames, among those of `_Seen`.
        moment, shaken, by_errors: (n r, ...) changes of the rows with the static unknowns, and with the errors.
        covariance, carried: of the active splines, as in `MotionSpread.active`.
        values: (3, n, 6) of these splines.
    """

    frames: slice
    moment: np.ndarray
    shaken: np.ndarray
    by_errors: np.ndarray
    covariance: np.ndarray
    carried: np.ndarray
    values: np.ndarray


def _intervals(spread: MotionSpread, seen: _Seen, root: np.ndarray) -> Iterator[_Interval]:
    """Yield the rows of `seen` knot interval by knot interval.

    `root` (n, n + u) belongs to the static unknowns that root equations depend on.
    """
    by, precision = seen.by, spread.carried.dtype
    (d, r, n), c, some = by.static.shape, by.q.shape[2], root.shape[1]
    still = by.static.reshape(-1, n).astype(precision) @ root.astype(precision)
    starts = np.flatnonzero(np.diff(seen.first, prepend=-1))
    for start, stop in zip(starts, np.append(starts[1:], d), strict=True):
        frames = slice(start, stop)
        covariance, carried = spread.active(int(seen.first[start]))
        values, orders = np.ascontiguousarray(seen.values[:, frames]), (by.q[frames], by.qd[frames], by.qdd[frames])
        by_splines = np.empty((2, stop - start, r, 6, c), precision)
        write_by_splines(values, *orders, by_splines[0])
        write_by_splines(seen.shares[:, None, None] * values, *orders, by_splines[1])
        plain, shaken = by_splines.reshape(2, -1, 6 * c)
        shaken *= seen.grown[frames].reshape(-1, 1)
        moment = plain @ carried.reshape(6 * c, -1)
        moment[:, :some] -= still[start * r : stop * r]
        yield _Interval(frames, moment, shaken, shaken @ covariance.astype(precision), covariance, carried, values)


def _write_variances(spread: MotionSpread, seen: _Seen, root: np.ndarray, into: CurveDeviations, rows: slice) -> None:
    """Write the variances of coordinates, moments and powers into rows of `into`, as if the delay were known."""
    sums = np.empty((4, *seen.by.static.shape[:2]))
    for interval in _intervals(spread, seen, root):
        errors = (interval.shaken, interval.by_errors, interval.covariance, interval.values, seen.shares)
        write_variances(interval.moment, interval.carried, *errors, sums[:, interval.frames])
    place, rate, force, both = sums
    value = seen.by.value
    into.coordinates[rows], into.moments[rows] = place, force
    into.powers[rows] = seen.speed**2 * force + value**2 * rate + 2.0 * seen.speed * value * both


def _joint_variances(spread: MotionSpread, seen: _Seen, root: np.ndarray) -> np.ndarray:
    """Return the variances (d, r) of rows of joints, with that of the delay."""
    result = seen.by.delay_squares.copy()
    for interval in _intervals(spread, seen, root) if result.shape[1] else ():
        variance = np.einsum("ij,ij->i", interval.moment, interval.moment)
        variance += np.einsum("ij,ij->i", interval.by_errors, interval.shaken)
        result[interval.frames] += variance.reshape(-1, result.shape[1])
    return result
