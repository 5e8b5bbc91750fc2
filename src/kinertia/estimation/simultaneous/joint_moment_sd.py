"""Standard deviations of joint moments, from motion, body segment parameters and calibration together.

Delta method: the joint moments' analytic derivatives by spline coefficients and static unknowns, times their posterior
covariance. Errors that come back (`repetition`) make the motion no vaguer, only what many frames say of what does not
move: what is left of the motion if that were known is that of the errors alone. Of the coefficients' covariance only
the blocks near the diagonal are needed, since six splines are active in any frame; they come from the block-banded
factor (`BlockBand.inverse_blocks`) and the static unknowns. They count by what is seen of the errors that they are from
(`motion_noise`). Added is what of the forces is faster than the motion
(`GroundReactions.impact`), as a moving mean square: whether it acts on the joints or is spent on segments that slow
down is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.elimination import Factored, Reduced
from kinertia.estimation.simultaneous.motion_noise import motion_noise
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, by_splines
from kinertia.estimation.simultaneous.problem import MapProblem, by_body
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.dynamics import Motion, axis_motion
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.moving_mean import moving_mean
from kinertia.motion.regressor import regressor
from kinertia.motion.rigid_body import axis_force_derivatives

_FRAMES_AT_ONCE = 100
"""Larger arrays would leave the processor's cache."""
_LOST_KNOTS = 2.0
"""Half of the stretch over which it is averaged, in knot intervals: one period of the cutoff."""


@dataclass(frozen=True)
class MomentDerivatives:
    """Derivatives of generalised forces at d frames.

    Attributes:
        q, qd, qdd: (d, c, c) by the coordinates that move and their rates.
        static: (d, c, s) by the static unknowns that root equations depend on.
        impact: (d, c) what impacts would add.
    """

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    impact: np.ndarray


def joint_moment_sd(
    problem: MapProblem,
    k: int,
    coefficients: np.ndarray,
    static: np.ndarray,
    eliminated: Reduced,
    root: np.ndarray,
) -> np.ndarray:
    """(d, c) posterior deviations of the generalised forces of trial k at its dynamic frames, N m and N.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients, static: the estimate.
        eliminated: the trial's normal equations there, undamped.
        root: (S, S) root of the posterior covariance of the static unknowns.
    """
    basis, frames = problem.bases[k], np.flatnonzero(problem.trials[k].dynamic)
    variance, impact = np.empty((2, len(frames), coefficients.shape[1]))
    reactions, spread = problem.reactions(k, static), None
    # errors that come back count more often only for what does not move
    shares = np.sqrt(motion_noise(problem, k, coefficients, static) / problem.trials[k].repeats)
    for part in eliminated.backwards():
        spread = _MotionSpread.of(part, coefficients.shape[1], root, spread)
        begin, end = np.searchsorted(frames, [part.stretch.frames.start, part.stretch.frames.stop])
        for start in range(begin, end, _FRAMES_AT_ONCE):
            rows = slice(start, min(start + _FRAMES_AT_ONCE, end))
            chosen = frames[rows]
            motion = problem.full(basis.evaluate(coefficients, chosen), static)
            by = moment_derivatives(problem, k, motion, static, reactions, chosen)
            still = by.static @ root[problem.layout.in_root]
            orders, values, shape = (by.q, by.qd, by.qdd), basis.values[:, chosen], (*by.q.shape[:2], -1)
            through = by_splines(values, *orders).reshape(shape)
            shaken = by_splines(values, *(share * each for share, each in zip(shares, orders, strict=True)))
            variance[rows] = spread.of_moments(basis.first[chosen], through, shaken.reshape(shape), still)
            impact[rows] = by.impact
    around = 1 + 2 * round(_LOST_KNOTS * len(basis.first) / (basis.size - 5))
    variance += moving_mean(np.square(impact), around)
    return np.sqrt(np.maximum(variance, 0.0))


def moment_derivatives(
    problem: MapProblem,
    k: int,
    motion: Sequence[np.ndarray],
    static: np.ndarray,
    reactions: GroundReactions,
    frames: np.ndarray,
) -> MomentDerivatives:
    """Derivatives of `dynamics.inverse_dynamics` at d frames of trial k.

    Args:
        problem: of the estimate.
        k: the trial.
        motion: all coordinates, static ones included, and their rates (d, c), as `MapProblem.full` has them.
        static: the estimate.
        reactions: `MapProblem.reactions` there.
        frames: (d,) indices.
    """
    trial, layout = problem.trials[k], problem.layout
    skeleton = problem.placed(static)
    q, qd, qdd = motion
    state = axis_motion(skeleton, Motion(q, qd, qdd))
    tree, gravity = skeleton.tree, skeleton.gravity_m_s2
    tau, (dq, dv, da) = axis_force_derivatives(tree, gravity, skeleton.bodies(problem.bsp(static)), *state)
    (d, axes), chain = tau.shape, dynamic_jacobian(static[layout.theta])
    time = trial.time[frames]
    loads, rates, fast = reactions.at(time), reactions.rate(time), reactions.impact_at(time)
    pose = skeleton.pose(q)
    rows = [skeleton.segments.index(segment) for segment in problem.segments]
    by_static, impact = np.zeros((d, axes, layout.in_root.stop)), np.zeros((d, axes))
    shown = by_body(regressor(tree, gravity, *state, np.zeros((d, 3)))[:, :, rows].reshape(d, 6, -1), chain)
    carried = np.repeat(skeleton.support[rows].T, 10, axis=1)
    by_static[:, :, layout.theta] = np.where(carried, pose.axes @ shown, 0.0)
    for foot, name in enumerate(skeleton.feet):
        moves = skeleton.support[skeleton.segments.index(name)]
        jacobian = pose.axes * moves[:, None]
        only = np.where(np.arange(2)[:, None] == foot, loads, 0.0)
        ground = problem.grounds[k]
        by_plate = ground.by_plate(only, ground.carrier[frames], problem.plate_values(static))
        by_plate = by_plate @ problem.to_plates
        by_static[:, :, layout.plates] -= jacobian @ by_plate
        by_static[:, :, layout.clock] -= (jacobian @ rates[:, foot, :, None])[..., 0]
        tau -= (jacobian @ loads[:, foot, :, None])[..., 0]
        impact -= (jacobian @ fast[:, foot, :, None])[..., 0]
        dq -= _load_derivative(pose, moves, loads[:, foot])
    by_q, by_qd, by_qdd = (
        _rows_to_coordinates(skeleton, pose, part)
        for part in skeleton.map.derivatives_to_coordinates((dq, dv, da), q, qd, qdd)
    )
    each = np.arange(q.shape[1])
    by_q[:, each, each] += skeleton.map.turned_forces(tau, q)
    by_static = _rows_to_coordinates(skeleton, pose, by_static)
    by_static[:, :, layout.coordinates] = by_q[:, :, problem.still]
    moving = problem.moving[:, None]
    by_q, by_qd, by_qdd = (part[:, moving, problem.moving] for part in (by_q, by_qd, by_qdd))
    impact = skeleton.map.to_coordinates(impact, pose.slopes)[:, problem.moving]
    return MomentDerivatives(by_q, by_qd, by_qdd, by_static[:, problem.moving], impact)


def _rows_to_coordinates(skeleton: Skeleton, pose: Pose, by: np.ndarray) -> np.ndarray:
    """(d, c, k) from (d, a, k): rows of axes to those of coordinates."""
    return skeleton.map.to_coordinates(by.transpose(0, 2, 1), pose.slopes).transpose(0, 2, 1)


def _load_derivative(pose: Pose, moves: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(d, a, a) derivative of J^T load by the axes' places, for a load (d, 6) at the ground origin.

    An axis turns the axes of all that come after it: column j of J changes by the motion product of i and j.
    """
    columns = pose.axes * moves[:, None]
    linear, angular = columns[..., :3], columns[..., 3:]
    force, moment = load[:, None, :3], load[:, None, 3:]
    # (J_i x J_j) . load = J_j . (load carried along by i)
    carried = np.concatenate([np.cross(force, angular), np.cross(moment, angular) + np.cross(force, linear)], axis=-1)
    changed = columns @ carried.transpose(0, 2, 1)
    order = np.arange(len(moves))
    return np.where(order[:, None] > order, changed, 0.0)


@dataclass(frozen=True)
class _MotionSpread:
    """How uncertain neighbouring spline coefficients of a stretch are, and how they go with the static unknowns.

    Attributes:
        start: the first of the splines.
        diagonal, below: blocks of SPLINES_PER_BLOCK splines (b, k, k), (b - 1, k, k) of their covariance if the static
            unknowns were known; with the first block after the stretch.
        carried: (splines, c, S) how far one deviation of each independent part of the static unknowns carries them.
    """

    start: int
    diagonal: np.ndarray
    below: np.ndarray
    carried: np.ndarray

    @classmethod
    def of(cls, part: Factored, c: int, root: np.ndarray, after: _MotionSpread | None) -> _MotionSpread:
        """Of a stretch, with this root (S, S) of the static unknowns' covariance; `after` is the next stretch's."""
        start, size = part.stretch.splines.start, len(root)
        if after is None:
            carried = part.band.backward(part.border @ root)
            return cls(start, *part.band.inverse_blocks(), carried.reshape(-1, c, size))
        block, first = after.diagonal[:1], after.carried[:SPLINES_PER_BLOCK]
        carried = part.band.backward(part.border @ root, first.reshape(-1, size)).reshape(-1, c, size)
        diagonal, below = part.band.inverse_blocks(block[0])
        return cls(start, np.append(diagonal, block, axis=0), below, np.append(carried, first, axis=0))

    def of_moments(self, first: np.ndarray, through: np.ndarray, shaken: np.ndarray, still: np.ndarray) -> np.ndarray:
        """(d, c) variances of moments.

        Args:
            first: (d,) the first active spline of each frame.
            through: (d, c, 6 c) derivatives by the coefficients of the active splines.
            shaken: the same, for what the markers' errors make of the motion alone.
            still: (d, c, S) what a deviation of each independent part of the static unknowns adds by itself.
        """
        variance = np.empty(through.shape[:2])
        for spline in np.unique(first):
            rows = np.flatnonzero(first == spline)
            own, carried = self._active(int(spline) - self.start)
            spread = ((shaken[rows] @ own) * shaken[rows]).sum(axis=-1)
            variance[rows] = spread + np.square(still[rows] - through[rows] @ carried).sum(axis=-1)
        return variance

    def _active(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """(6 c, 6 c) covariance and (6 c, S) of the six splines from `first` on."""
        block, offset = divmod(first, SPLINES_PER_BLOCK)
        pair = np.block(
            [
                [self.diagonal[block], self.below[block].T],
                [self.below[block], self.diagonal[block + 1]],
            ]
        )
        c = self.carried.shape[1]
        here = slice(offset * c, (offset + 6) * c)
        return pair[here, here], self.carried[first : first + 6].reshape(6 * c, -1)
