"""Computes joint moments, and the derivatives of moments and ground reactions by all unknowns."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.axis_columns import add_bodies, take_load
from kinertia.estimation.simultaneous.delayed_loads import DelayedLoads, delayed_loads
from kinertia.estimation.simultaneous.inputs import BSP, STILL
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.model.log_cholesky import by_body, dynamic_jacobian
from kinertia.motion.dynamics import Motion, axis_motion
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.regressor import regressor
from kinertia.motion.rigid_body import axis_force_derivatives


@dataclass(frozen=True)
class MomentDerivatives:
    """Generalised forces at d frames, and their derivatives.

    Attributes:
        value: (d, c) the forces themselves, N m and N.
        q, qd, qdd: (d, c, c) derivatives by the coordinates that move and their rates.
        static: (d, c, s) derivatives by the static unknowns that root equations depend on.
        impact: (d, c) contribution of impact transients.
        ground: (d, 6, s) derivative of the ground reactions on the right foot, then the left (N).
        delay_squares, ground_delay_squares: (d, c), (d, 6) mean squares of the remaining effect of the delay of the
            forces (`DelayedLoads.residual`).
    """

    value: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    impact: np.ndarray
    ground: np.ndarray
    delay_squares: np.ndarray
    ground_delay_squares: np.ndarray


def moment_derivatives(
    problem: MapProblem,
    k: int,
    motion: Sequence[np.ndarray],
    static: np.ndarray,
    reactions: GroundReactions,
    frames: np.ndarray,
    delay_sd_s: float = 0.0,
) -> MomentDerivatives:
    """Compute the derivatives of `dynamics.inverse_dynamics` at d frames of trial k.

    Args:
        problem: of the estimate.
        k: the trial.
        motion: all coordinates, including static ones, and their rates (d, c), as in `FreedModel.full`.
        static: the estimate.
        reactions: `GroundLoads.reactions` there.
        frames: (d,) indices.
        delay_sd_s: standard deviation of the delay of the forces, over which derivatives by it are averaged.
    """
    skeleton, layout = problem.model.placed(static), problem.layout
    q, qd, qdd = motion
    state = axis_motion(skeleton, Motion(q, qd, qdd))
    bodies, moving, row = skeleton.bodies(problem.model.bsp(static)), problem.moving, np.full(q.shape[1], -1)
    row[moving] = np.arange(len(moving))
    rows = row[skeleton.map.owner]
    tau, (dq, dv, da) = axis_force_derivatives(skeleton.tree, skeleton.gravity_m_s2, bodies, *state, rows >= 0)
    pose, impact = skeleton.pose(q), np.zeros(tau.shape)
    slopes = np.ones(tau.shape) if pose.slopes is None else np.ascontiguousarray(pose.slopes)
    axes = pose.axes, slopes, rows
    by_static = np.zeros((len(q), len(moving), layout.in_root.stop))
    carrying = [skeleton.segments.index(segment) for segment in problem.model.segments]
    shown = regressor(skeleton.tree, skeleton.gravity_m_s2, *state, np.zeros((len(q), 3)))[:, :, carrying]
    shown = by_body(shown.reshape(len(q), 6, -1), dynamic_jacobian(static[layout[BSP]]))
    add_bodies(*axes, skeleton.support[carrying], shown, by_static)
    late = delayed_loads(reactions, problem.trials[k].time[frames], delay_sd_s)
    loads, by_load = _loads(problem, k, static, reactions, frames, late)
    fast = reactions.impact_at(problem.trials[k].time[frames])
    left = np.zeros((len(late.residual), *tau.shape))
    for foot, name in enumerate(skeleton.feet):
        moved = np.flatnonzero(skeleton.support[skeleton.segments.index(name)])
        take_load(*axes, moved, loads[foot], by_load[foot], layout.errors.start, tau, dq, by_static)
        impact[:, moved] -= (pose.axes[:, moved] @ fast[:, foot, :, None])[..., 0]
        left[..., moved] -= np.einsum("dai,mdi->mda", pose.axes[:, moved], late.residual[:, :, foot])
    by_q, by_qd, by_qdd = (
        skeleton.map.to_coordinates(part.transpose(0, 2, 1), pose.slopes).transpose(0, 2, 1)
        for part in skeleton.map.derivatives_to_coordinates((dq, dv, da), q, qd, qdd)
    )
    each = np.arange(q.shape[1])
    by_q[:, each, each] += skeleton.map.turned_forces(tau, q)
    by_static[:, :, layout[STILL]] = by_q[:, moving[:, None], problem.given.still]
    by_q, by_qd, by_qdd = (part[:, moving[:, None], moving] for part in (by_q, by_qd, by_qdd))
    value, impact = (skeleton.map.to_coordinates(each, pose.slopes)[:, moving] for each in (tau, impact))
    ground = by_load[:, :, :3].transpose(1, 0, 2, 3).reshape(len(q), -1, layout.in_root.stop)
    of_delays = [np.square(skeleton.map.to_coordinates(each, pose.slopes)[:, moving]) for each in left]
    squares = np.sum(of_delays, axis=0) if of_delays else np.zeros(value.shape)
    of_ground = np.square(late.residual[..., :3]).sum(axis=0).reshape(len(q), -1)
    return MomentDerivatives(value, by_q, by_qd, by_qdd, by_static, impact, ground, squares, of_ground)


def _loads(
    problem: MapProblem, k: int, static: np.ndarray, reactions: GroundReactions, frames: np.ndarray, late: DelayedLoads
) -> tuple[np.ndarray, np.ndarray]:
    """Return loads on the feet (2, d, 6), and their derivatives by the static unknowns (2, d, 6, s)."""
    time = problem.trials[k].time[frames]
    loads = late.loads
    by_load = np.zeros((loads.shape[1], len(time), 6, problem.layout.in_root.stop))
    for by, add in problem.loads.by_errors(k, static, loads, reactions.loaded_at(time), frames):
        for foot, own in enumerate(by_load):
            add(own, by[:, foot])
    by_load[..., problem.loads.delay_unknowns(k)] = late.slope.transpose(1, 0, 2)[..., None]
    return np.ascontiguousarray(loads.transpose(1, 0, 2)), by_load
