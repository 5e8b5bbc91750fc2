"""Joint moments, and their and the ground reactions' derivatives by motion, body segment parameters and calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.model.log_cholesky import by_body, dynamic_jacobian
from kinertia.model.skeleton import Pose, Skeleton
from kinertia.motion.dynamics import Motion, axis_motion
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.regressor import regressor
from kinertia.motion.rigid_body import axis_force_derivatives


@dataclass(frozen=True)
class MomentDerivatives:
    """Generalised forces at d frames and their derivatives.

    Attributes:
        value: (d, c) the forces themselves, N m and N.
        q, qd, qdd: (d, c, c) by the coordinates that move and their rates.
        static: (d, c, s) by the static unknowns that root equations depend on.
        impact: (d, c) what impacts would add.
        ground: (d, 6, s) derivative of the ground reactions on the right foot, then the left (N).
    """

    value: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    impact: np.ndarray
    ground: np.ndarray


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
    (loads, rates), fast = reactions.with_rate(time), reactions.impact_at(time)
    ground = problem.grounds[k]
    by_plate = ground.by_plate(loads, reactions.loaded_at(time), ground.carrier[frames], problem.plates_in(k, static))
    pose = skeleton.pose(q)
    rows = [skeleton.segments.index(segment) for segment in problem.segments]
    by_static, impact = np.zeros((d, axes, layout.in_root.stop)), np.zeros((d, axes))
    by_ground = np.zeros((d, len(skeleton.feet), 3, layout.in_root.stop))
    shown = by_body(regressor(tree, gravity, *state, np.zeros((d, 3)))[:, :, rows].reshape(d, 6, -1), chain)
    carried = np.repeat(skeleton.support[rows].T, 10, axis=1)
    by_static[:, :, layout.theta] = np.where(carried, pose.axes @ shown, 0.0)
    for foot, name in enumerate(skeleton.feet):
        moves = skeleton.support[skeleton.segments.index(name)]
        jacobian = pose.axes * moves[:, None]
        by_load = np.zeros((d, 6, layout.in_root.stop))
        problem.add_by_plates(k, by_load, by_plate[:, foot])
        by_load[:, :, layout.late(k)] = rates[:, foot, :, None]
        by_static[:, :, layout.instruments] -= jacobian @ by_load[:, :, layout.instruments]
        tau -= (jacobian @ loads[:, foot, :, None])[..., 0]
        by_ground[:, foot] = by_load[:, :3]
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
    value, impact = (skeleton.map.to_coordinates(each, pose.slopes)[:, problem.moving] for each in (tau, impact))
    by_ground = by_ground.reshape(d, -1, by_ground.shape[-1])
    return MomentDerivatives(value, by_q, by_qd, by_qdd, by_static[:, problem.moving], impact, by_ground)


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
