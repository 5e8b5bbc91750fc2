"""The root equations at some frames of a trial: linearised, or where they pull, over their deviations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous.layout import Layout
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import Gradient, RootTerms
from kinertia.estimation.simultaneous.root_gradient import add_root_gradient
from kinertia.estimation.simultaneous.trunk_bending import BentTrunk
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.kinematic_tree import KinematicTree
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, axis_motion
from kinertia.motion.root_columns import Columns, root_columns

_Moving = tuple[
    KinematicTree,
    float,
    np.ndarray,
    tuple[np.ndarray, np.ndarray, np.ndarray],
    np.ndarray,
    tuple[np.ndarray, np.ndarray],
]
"""What both compiled functions begin with."""


@dataclass(frozen=True, eq=False)
class RootFrames:
    """The root equations at d frames of a trial, with all that they are made of.

    Attributes:
        skeleton: freed, with all coordinates.
        bsp: body segment parameters, and
        theta: (10 b,) the unknowns that they are made from.
        motion: of all coordinates.
        wrench: (d, 6) sum of the ground reactions at the ground origin: N, N m.
        by_plates, by_own: (d, 6, p, 7), (d, 6, 1 or 2) its derivatives by what is wrong with plates, and by time and by
            how much a trunk bends.
        add_by_ground: adds such derivatives to those by static unknowns: `MapProblem.add_by_ground`.
        sd: (d, 6) deviations of the residuals.
        frames: (d,) indices.
        static: how many static unknowns they depend on.
        trunk: that bends; None: all segments are rigid.
    """

    skeleton: Skeleton
    bsp: BodySegmentParameters
    theta: np.ndarray
    motion: Motion
    wrench: np.ndarray
    by_plates: np.ndarray
    by_own: np.ndarray
    add_by_ground: Callable[[np.ndarray, np.ndarray, np.ndarray], None]
    sd: np.ndarray
    frames: np.ndarray
    static: int
    trunk: BentTrunk | None = None

    def bent(self, trunk: BentTrunk) -> RootFrames:
        """The same with a trunk that bends."""
        by_kappa = trunk.by_kappa(self.wrench)
        return replace(
            self,
            bsp=trunk.bsp(self.bsp),
            wrench=trunk.upright(self.wrench),
            by_plates=trunk.upright(self.by_plates),
            by_own=np.concatenate([trunk.upright(self.by_own), by_kappa[..., None]], axis=2),
            trunk=trunk,
        )

    def terms(self, columns: Columns) -> RootTerms:
        """Residuals and derivatives, each over its deviation; `columns` are `columns_of` the problem."""
        by_static = np.zeros((len(self.frames), 6, self.static))
        self.add_by_ground(by_static, self.by_plates, self.by_own)
        chain = dynamic_jacobian(self.theta)
        left, (q, qd, qdd) = root_columns(*self._moving, self.wrench, chain, self.sd, columns, by_static)
        if self.trunk is not None:
            by_static[:, :, self.trunk.place] += by_static[:, :, self.trunk.unknowns] @ self.trunk.by_unknowns(
                self.theta
            )
        return RootTerms(self.frames, q, qd, qdd, by_static, left)

    def add_gradient(self, into: Gradient, columns: Columns, basis: MotionBasis, start: int) -> None:
        """Add half the sum of squares and where it falls, in a fraction of the time; `start` is the spline with which
        the gradient begins.
        """
        of_basis = basis.first[self.frames] - start, np.ascontiguousarray(basis.values[:, self.frames])
        cost, by_bodies, by_ground = add_root_gradient(
            *self._moving, self.wrench, self.sd, columns, of_basis, into.right, into.static_right
        )
        into.cost += cost
        into.static_right[: self.theta.size] -= np.einsum("bi,bij->bj", by_bodies, dynamic_jacobian(self.theta)).ravel()
        by_static = np.zeros((1, 1, self.static))
        by_plates = np.einsum("nr,nrpe->pe", by_ground, self.by_plates)
        by_own = np.einsum("nr,nre->e", by_ground, self.by_own)
        self.add_by_ground(by_static, by_plates[None, None], by_own[None, None])
        into.static_right[: self.static] += by_static[0, 0]
        if self.trunk is not None:
            into.static_right[self.trunk.place] -= by_bodies[self.trunk.trunk.row] @ self.trunk.trunk.parameters

    @property
    def _moving(self) -> _Moving:
        """The body, its motion, and where moments are taken about."""
        motion, skeleton = self.motion, self.skeleton
        return (
            skeleton.tree,
            skeleton.gravity_m_s2,
            skeleton.bodies(self.bsp),
            axis_motion(skeleton, motion),
            skeleton.map.bends(motion.q, motion.qd, motion.qdd),
            (np.ascontiguousarray(skeleton.root.centre(motion.q)), skeleton.root.moves),
        )


def columns_of(
    skeleton: Skeleton, segments: Sequence[str], moving: np.ndarray, still: np.ndarray, layout: Layout
) -> Columns:
    """Where the derivatives go, of these segments' parameters and of coordinates of a freed skeleton: indices of those
    that move, and of those that do not.
    """
    to_moving, to_still = np.full((2, len(skeleton.coordinates)), -1)
    to_moving[moving] = np.arange(len(moving))
    to_still[still] = np.arange(layout.coordinates.start, layout.coordinates.stop)
    owner = skeleton.map.owner
    rows = np.array([skeleton.segments.index(segment) for segment in segments])
    instruments = layout.instruments
    return Columns(to_moving[owner], to_still[owner], rows, len(moving), instruments.start, instruments.stop)
