"""Computes joint moments, and the derivatives of moments and ground reactions by all unknowns.

Besides the generalised forces these are the three-dimensional moments and forces of `body_joints`, which virtual axes
give (`joint_moments`), projected on the axes of the joint coordinate system (`joint_rows`).

At foot contact and foot off, forces change within a shorter time, and a time derivative does not describe the effect of
a delay. It is replaced by the regression of the loads on the delay, over all likely delays (statistical linearisation),
which enters like a derivative. Its residual is added as independent. Both together are the mean square change of the
loads, however they change.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.inputs import BSP, STILL
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.uncertainty.joint_rows import JointRows, add_bodies, take_load
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, axis_motion, regressor
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import VirtualAxes, body_joints
from kinertia.motion.rigid_body import axis_force_derivatives

_DELAYS = np.linspace(-4.0, 4.0, 25)
"""Delays in standard deviations, over which the mean squares are taken."""


@dataclass(frozen=True)
class DelayedLoads:
    """Loads (N, N m) at n times on right and left foot, and the effect of a delay.

    Attributes:
        loads: (n, 2, 6) without delay.
        slope: (n, 2, 6) per s of delay.
        residual: (n, m, 2, 6) residuals from the slope for m delays, times the root of their probability, so that
            the sum of squares is a mean square; empty (m = 0) if the delay is known.
    """

    loads: np.ndarray
    slope: np.ndarray
    residual: np.ndarray


def delayed_loads(reactions: GroundReactions, time: np.ndarray, sd_s: float = 0.0) -> DelayedLoads:
    """Compute the loads at times (n,) s for a delay with this SD (s); with zero SD the slope is the derivative."""
    loads, rates = reactions.with_rate(time)
    n = len(time)
    if sd_s == 0.0:
        return DelayedLoads(loads, rates, np.empty((n, 0, 2, 6)))
    weights = np.exp(-0.5 * np.square(_DELAYS))
    weights /= weights.sum()
    delays = sd_s * _DELAYS
    later = reactions.at((time[:, None] + delays).ravel())
    changes = later.reshape(n, len(delays), 12) - loads.reshape(n, 1, 12)
    slope = (weights * delays / (weights @ np.square(delays))) @ changes
    residual = np.sqrt(weights)[:, None] * (changes - delays[:, None] * slope[:, None])
    return DelayedLoads(loads, slope.reshape(n, 2, 6), residual.reshape(n, -1, 2, 6))


@dataclass(frozen=True)
class MomentDerivatives:
    """Generalised forces of c coordinates and six components of each of j joints at d frames, and their derivatives.

    The r = c + 6 j rows are those of the coordinates, then of each joint the moments of `joint_moments` about its axes
    (without their signs) and the forces along them.

    Attributes:
        value: (d, r) the forces themselves, N m and N.
        q, qd, qdd: (d, r, c) derivatives by the coordinates that move and their rates.
        static: (d, r, s) derivatives by the static unknowns that root equations depend on.
        uncertain: (d, r) contribution of `GroundReactions.uncertain`.
        loads: (d, 2, 6) on right and left foot, N and N m.
        ground: (d, 6, e) derivatives of the ground reactions on right foot, then left (N), by the instruments' errors.
        delay_squares, ground_delay_squares: (d, r), (d, 6) mean squares of the remaining effect of the delay of the
            forces (`DelayedLoads.residual`).
    """

    value: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    uncertain: np.ndarray
    loads: np.ndarray
    ground: np.ndarray
    delay_squares: np.ndarray
    ground_delay_squares: np.ndarray

    def rows(self, some: slice) -> Self:
        """Return these rows."""
        names = ("value", "q", "qd", "qdd", "static", "uncertain", "delay_squares")
        return replace(self, **{name: np.ascontiguousarray(getattr(self, name)[:, some]) for name in names})


@dataclass(frozen=True, eq=False)
class MomentsOfTrial:
    """Joint moments of a trial, as a function of its motion.

    Attributes:
        problem: of the estimate.
        k: the trial.
        static: the estimate.
        reactions: `GroundLoads.reactions` there.
        delay_sd_s: standard deviation of the delay of the forces, over which derivatives by it are averaged.
    """

    problem: MapProblem
    k: int
    static: np.ndarray
    reactions: GroundReactions
    delay_sd_s: float = 0.0

    @cached_property
    def virtual(self) -> VirtualAxes:
        """The freed skeleton with virtual axes of its joints."""
        free = self.problem.model.placed(self.static)
        return VirtualAxes.of(free, body_joints(self.problem.skeleton))

    @property
    def _skeleton(self) -> Skeleton:
        return self.virtual.skeleton

    @cached_property
    def _columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates of the skeleton with virtual axes that move, that do not, and of all rows."""
        moving, still = (self.virtual.former[columns] for columns in (self.problem.moving, self.problem.given.still))
        return moving, still, np.concatenate([moving, self.virtual.added.ravel()])

    @cached_property
    def _bodies(self) -> np.ndarray:
        return self._skeleton.bodies(self.problem.model.bsp(self.static))

    @cached_property
    def _segments(self) -> np.ndarray:
        return np.array([self._skeleton.segments.index(segment) for segment in self.problem.model.segments])

    @cached_property
    def _chain(self) -> np.ndarray:
        return dynamic_jacobian(self.static[self.problem.layout[BSP]])

    @cached_property
    def _rows(self) -> np.ndarray:
        """Row (a,) of each axis' coordinate; -1 for none."""
        every, row = self._columns[2], np.full(len(self._skeleton.coordinates), -1)
        row[every] = np.arange(len(every))
        result: np.ndarray = row[self._skeleton.map.owner]
        return result

    def derivatives(self, motion: Sequence[np.ndarray], frames: np.ndarray) -> MomentDerivatives:
        """Compute the derivatives of `dynamics.inverse_dynamics` at d frames.

        Args:
            motion: all coordinates, including static ones, and their rates (d, c), as in `FreedModel.full`.
            frames: (d,) indices.
        """
        skeleton, layout, rows = self._skeleton, self.problem.layout, self._rows
        moving, still, every = self._columns
        q, qd, qdd = map(self.virtual.embedded, motion)
        state, pose = axis_motion(skeleton, Motion(q, qd, qdd)), skeleton.pose(q)
        core = skeleton.tree, skeleton.gravity_m_s2
        origin = np.zeros((len(q), 3))
        tau, _, (dq, dv, da), _ = axis_force_derivatives(*core, self._bodies, *state, origin, rows >= 0)
        slopes = np.ones(tau.shape) if pose.slopes is None else np.ascontiguousarray(pose.slopes)
        by_static = np.zeros((len(q), len(every), layout.in_root.stop))
        support = skeleton.support[self._segments]
        by_parameter = regressor(*core, *state, origin)
        add_bodies(pose.axes, slopes, rows, support, by_parameter, self._segments, self._chain, by_static)
        time = self.problem.trials[self.k].time[frames]
        late = delayed_loads(self.reactions, time, self.delay_sd_s)
        by_load, along = self._by_load(late, frames), np.zeros((len(q), 2, 6, tau.shape[1]))
        for foot, name in enumerate(skeleton.feet):
            moved = np.flatnonzero(skeleton.support[skeleton.segments.index(name)])
            load = np.ascontiguousarray(late.loads[:, foot])
            first = layout.errors.start
            take_load(pose.axes, slopes, rows, moved, load, by_load[foot], first, tau, dq, by_static)
            along[:, foot, :, moved] = pose.axes[:, moved].transpose(1, 0, 2)
        by_q, by_qd, by_qdd = (
            skeleton.map.to_coordinates(part.transpose(0, 2, 1), pose.slopes).transpose(0, 2, 1)
            for part in skeleton.map.derivatives_to_coordinates((dq, dv, da), q, qd, qdd)
        )
        coordinates = np.arange(q.shape[1])
        by_q[:, coordinates, coordinates] += skeleton.map.turned_forces(tau, q)
        by_forces = tau, along.reshape(len(q), 12, -1)
        value, reach = (skeleton.map.to_coordinates(by_force, pose.slopes)[..., every] for by_force in by_forces)
        joints = JointRows.of(self.virtual, pose, len(moving))
        by_q, by_qd, by_qdd = (joints.turned(part.take(every, axis=1)) for part in (by_q, by_qd, by_qdd))
        by_q += joints.by_axes(value)
        by_static = joints.turned(by_static)
        by_static[:, :, layout[STILL]] = by_q[:, :, still]
        by_q, by_qd, by_qdd = (part.take(moving, axis=2) for part in (by_q, by_qd, by_qdd))
        value, reach = joints.turned(value[..., None])[..., 0], joints.turned(reach.swapaxes(1, 2)).swapaxes(1, 2)
        fast = self.reactions.uncertain_at(time).reshape(len(q), 1, 12)
        ground = by_load[:, :, :3, layout.errors].transpose(1, 0, 2, 3).reshape(len(q), 6, -1)
        return MomentDerivatives(
            value,
            by_q,
            by_qd,
            by_qdd,
            by_static,
            -(fast @ reach)[:, 0],
            late.loads,
            ground,
            np.square(late.residual.reshape(len(q), -1, 12) @ reach).sum(axis=1),
            np.square(late.residual[..., :3]).sum(axis=1).reshape(len(q), -1),
        )

    def _by_load(self, late: DelayedLoads, frames: np.ndarray) -> np.ndarray:
        """Return the derivatives (2, d, 6, s) of the loads on right and left foot by the static unknowns."""
        problem, k, time = self.problem, self.k, self.problem.trials[self.k].time[frames]
        result = np.zeros((2, len(time), 6, problem.layout.in_root.stop))
        loaded = self.reactions.loaded_at(time)
        for by, add in problem.loads.by_errors(k, self.static, late.loads, loaded, frames):
            for foot, of_foot in enumerate(result):
                add(of_foot, by[:, foot])
        result[..., problem.loads.delay_unknowns(k)] = late.slope.transpose(1, 0, 2)[..., None]
        return result
