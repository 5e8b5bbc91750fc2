"""Evaluates the root equations at some frames of a trial, linearised or as a gradient, in standard deviations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.inputs import STILL, Layout
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import (
    NO_BORDER,
    Gradient,
    NormalEquations,
    write_by_splines,
)
from kinertia.estimation.simultaneous.terms.root_equations import Columns, add_root_gradient, root_columns
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.compiled import Float2, Float4, Int1, StridedFloat3, compiled
from kinertia.model.kinematic_tree import KinematicTree
from kinertia.model.log_cholesky import dynamic_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, axis_motion

_Moving = tuple[
    KinematicTree,
    float,
    np.ndarray,
    tuple[np.ndarray, np.ndarray, np.ndarray],
    np.ndarray,
    tuple[np.ndarray, np.ndarray],
]
"""Common first arguments of both compiled functions."""


@dataclass(frozen=True)
class RootTerms:
    """Residuals of the root equations at the dynamic frames and their derivatives, each over its standard deviation.

    Attributes:
        frames: (d,) indices.
        q, qd, qdd: (d, 6, c) by the coordinates that move, and their rates.
        static: (d, 6, s) by the static unknowns that they depend on.
        left: (d, 6) residuals.
    """

    frames: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    left: np.ndarray


class OfSegment(NamedTuple):
    """An unknown that changes the dynamic parameters of a segment.

    Attributes:
        place: index of the unknown among the static ones.
        row: index of the segment.
        parameters: (10,) the change per unit.
    """

    place: int
    row: int
    parameters: np.ndarray


@dataclass(frozen=True, eq=False)
class RootFrames:
    """The root equations at d frames of a trial, with all that they consist of.

    Attributes:
        skeleton: freed, with all coordinates.
        bsp: body segment parameters.
        theta: (10 b,) the unknowns that they are computed from.
        motion: of all coordinates.
        wrench: (d, 6) sum of the ground reactions at the ground origin: N, N m.
        by_errors: its derivatives (d, 6, ...) by errors of the ground reactions, each with the function that adds such
            derivatives, (n, r, ...), to those by all static unknowns (n, r, s).
        by_single: (d, 6, e) its derivatives by e quantities such as time, each of which is a sum of unknowns.
        at: indices of these unknowns.
        sd: (d, 6) standard deviations of the residuals.
        frames: (d,) indices.
        static: number of static unknowns that they depend on.
        of_segments: other unknowns than theta that change a segment; `bsp` includes their values.
    """

    skeleton: Skeleton
    bsp: BodySegmentParameters
    theta: np.ndarray
    motion: Motion
    wrench: np.ndarray
    by_errors: tuple[tuple[np.ndarray, Callable[[np.ndarray, np.ndarray], None]], ...]
    by_single: np.ndarray
    at: tuple[Sequence[int], ...]
    sd: np.ndarray
    frames: np.ndarray
    static: int
    of_segments: tuple[OfSegment, ...] = ()

    @property
    def of_motion(self) -> "RootFrames":
        """The equations with all that does not move known."""
        return replace(self, by_errors=(), at=(), static=0, of_segments=())

    def terms(self, columns: Columns) -> RootTerms:
        """Return residuals and derivatives, each over its standard deviation; `columns` come from `columns_of`."""
        by_static = np.zeros((len(self.frames), 6, self.static))
        for by, add in self.by_errors:
            add(by_static, by)
        for quantity, places in enumerate(self.at):
            by_static[:, :, places] += self.by_single[:, :, quantity : quantity + 1]
        chain = dynamic_jacobian(self.theta)
        left, (q, qd, qdd) = root_columns(*self._moving, self.wrench, chain, self.sd, columns, by_static)
        for segment in self.of_segments:
            rows = slice(10 * segment.row, 10 * segment.row + 10)
            # the step of the segment's unknowns that changes its parameters by the same amount
            step = np.linalg.solve(dynamic_jacobian(self.theta[rows])[0], segment.parameters)
            by_static[:, :, segment.place] += by_static[:, :, rows] @ step
        return RootTerms(self.frames, q, qd, qdd, by_static, left)

    def add_gradient(self, into: Gradient, columns: Columns, basis: MotionBasis, start: int) -> None:
        """Add half the sum of squares and minus its gradient, in a fraction of the time of `terms`.

        `start` is the spline with which the gradient begins.
        """
        of_basis = basis.first[self.frames] - start, np.ascontiguousarray(basis.values[:, self.frames])
        cost, by_bodies, pulls = add_root_gradient(
            *self._moving, self.wrench, self.sd, columns, of_basis, into.rhs, into.static_rhs
        )
        into.cost += cost
        into.static_rhs[: self.theta.size] -= np.einsum("bi,bij->bj", by_bodies, dynamic_jacobian(self.theta)).ravel()
        by_static = np.zeros((1, 1, self.static))
        for by, add in self.by_errors:
            add(by_static, np.einsum("nr,nr...->...", pulls, by)[None, None])
        for places, pull in zip(self.at, np.einsum("nr,nre->e", pulls, self.by_single), strict=True):
            by_static[:, :, places] += pull
        into.static_rhs[: self.static] += by_static[0, 0]
        for segment in self.of_segments:
            into.static_rhs[segment.place] -= by_bodies[segment.row] @ segment.parameters

    @property
    def _moving(self) -> _Moving:
        """The body, its motion, and the point about which moments are taken."""
        motion, skeleton = self.motion, self.skeleton
        return (
            skeleton.tree,
            skeleton.gravity_m_s2,
            skeleton.bodies(self.bsp),
            axis_motion(skeleton, motion),
            skeleton.map.chain(motion.q, motion.qd, motion.qdd),
            (np.ascontiguousarray(skeleton.root.centre(motion.q)), skeleton.root.moves),
        )


def columns_of(
    skeleton: Skeleton, segments: Sequence[str], moving: np.ndarray, still: np.ndarray, layout: Layout
) -> Columns:
    """Return where the derivatives go: by these segments' parameters, and by the coordinates of a freed skeleton.

    `moving` and `still` are indices of coordinates that move, and that do not.
    """
    to_moving, to_still = np.full((2, len(skeleton.coordinates)), -1)
    to_moving[moving] = np.arange(len(moving))
    to_still[still] = np.arange(layout[STILL].start, layout[STILL].stop)
    owner = skeleton.map.owner
    rows = np.array([skeleton.segments.index(segment) for segment in segments])
    return Columns(to_moving[owner], to_still[owner], rows, len(moving), layout.errors.start, layout.errors.stop)


def add_root(into: NormalEquations, columns: slice, basis: MotionBasis, start: int, root: RootTerms) -> None:
    """Add the terms of the root equations at some frames, one knot interval at a time.

    Args:
        into: zero, or with other terms.
        columns: slice of the static unknowns that the root equations depend on.
        basis: of the motion.
        start: the spline with which the normal equations begin.
        root: the terms.
    """
    left, knots = root.left, basis.first[root.frames]
    (_, _, c), wide = root.q.shape, root.static.shape[2]
    flat = root.static.reshape(6 * len(left), wide)
    into.static_rhs[columns] -= flat.T @ left.ravel()
    into.cost += 0.5 * float(np.square(left).sum())
    intervals, begins = np.unique(knots, return_index=True)
    values = np.ascontiguousarray(basis.values[:, root.frames])
    pulls = [(left[:, None] @ by)[:, 0] for by in (root.q, root.qd, root.qdd)]
    for i in range(6):
        pulled = sum(value[:, i, None] * pull for value, pull in zip(values, pulls, strict=True))
        into.rhs[intervals - start + i] -= np.add.reduceat(pulled, begins, axis=0)
    if into.bordered:
        into.static[columns, columns] += flat.T @ flat
    rows = np.empty((len(left), 6, 6, c))
    write_by_splines(values, root.q, root.qd, root.qdd, rows)
    border = into.border[..., columns] if into.bordered else NO_BORDER
    _add_intervals(
        rows.reshape(-1, 6 * c),
        flat,
        intervals - start,
        6 * np.append(begins, len(knots)),
        into.band,
        border,
        into.bordered,
    )


@compiled
def _add_intervals(
    rows: Float2,
    static: Float2,
    first: Int1,
    ends: Int1,
    band: Float4,
    border: StridedFloat3,
    bordered: bool,
) -> None:
    """Add squares of derivatives by spline coefficients, rows (6 d, 6 c), and products with static ones (6 d, s).

    The products are added if `bordered`. Rows of an interval begin and end at `ends`, its splines begin at `first`.
    """
    c = band.shape[2]
    for k in range(len(first)):
        in_interval, at = rows[ends[k] : ends[k + 1]], first[k]
        square = np.dot(in_interval.T, in_interval)
        for i in range(6):
            for row in range(c):
                for j in range(i, 6):
                    for column in range(c):
                        band[at + i, j - i, row, column] += square[i * c + row, j * c + column]
        if not bordered:
            continue
        across = np.dot(in_interval.T, static[ends[k] : ends[k + 1]])
        for i in range(6):
            for row in range(c):
                for s in range(across.shape[1]):
                    border[at + i, row, s] += across[i * c + row, s]
