"""Computes the root equations and all their derivatives over standard deviations, in compiled code.

They equal those of `residual_terms` and `root_regressor` of `dynamics`, for coordinates that move, for some that do
not, for the bodies and for the ground reactions, but are computed in one pass and only as far as needed.
"""

from typing import NamedTuple

import numpy as np

from kinertia.model.compiled import Float2, Float3, Int1, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, place_segments
from kinertia.motion.regressor import in_segment, own_regressor
from kinertia.motion.rigid_body import Frame, differentiate, empty_frame, fill, taken_about, whole_load


class Columns(NamedTuple):
    """Columns to which derivatives are written.

    Attributes:
        moving: (a,) column of each axis' coordinate among those that move; -1 for none.
        still: (a,) column of each axis' coordinate among the static unknowns; -1 for none.
        segments: (b,) index of each body's segment; its ten unknowns are among the first of the static ones.
        wide: number of coordinates that move, c.
        first, last: columns of the unknowns that the ground reactions depend on, last not included.
    """

    moving: Int1
    still: Int1
    segments: Int1
    wide: int
    first: int
    last: int

    @property
    def of_motion(self) -> "Columns":
        """The columns of the coordinates that move, and no others."""
        return self._replace(still=np.full_like(self.still, -1), segments=self.segments[:0], first=0, last=0)


@compiled
def root_columns(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: Float2,
    motion: tuple[Float2, Float2, Float2],
    bends: Float3,
    root: tuple[Float2, Float2],
    wrench: Float2,
    chain: Float3,
    sd: Float2,
    columns: Columns,
    static: Float3,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute residuals (n, 6) of the root equations over their SDs, and derivatives (3, n, 6, c) by the coordinates.

    The derivatives are by coordinates, rates and accelerations.

    Args:
        tree, gravity_m_s2, bodies: as in `axis_forces`.
        motion: (n, a) values, rates and accelerations of the axes.
        bends: (n, a, 3) dependence of axes on their coordinates, `CoordinateMap.bends`; n is 0 if each axis is its
            coordinate.
        root: (n, 3) m, point about which moments are taken, and (3, 3) directions in which the first three coordinates
            move it, in rows.
        wrench: (n, 6) ground reactions at the ground origin.
        chain: (b, 10, 10) derivatives of each body's parameters by its unknowns.
        sd: (n, 6) standard deviations.
        columns: where derivatives are written.
        static: (n, 6, s) derivatives of the ground reactions by static unknowns; those of the residual are written.
    """
    (x, v, a), (about, slides) = motion, root
    n, count = x.shape
    left, by = np.zeros((n, 6)), np.zeros((3, n, 6, columns.wide))
    frame, column = empty_frame(count, gravity_m_s2), np.empty((3, 6))
    rotation, translation = np.empty((len(tree.carrier), 3, 3)), np.empty((len(tree.carrier), 3))
    load = np.empty(6)
    for i in range(n):
        fill(tree, bodies, x[i], v[i], a[i], frame)
        differentiate(tree, bodies, frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        whole_load(tree.parent, frame.force, left, i)
        for r in range(6):
            load[r] = left[i, r] - wrench[i, r]
        taken_about(load, about[i], left[i])
        for j in range(count):
            for order in range(3):
                taken_about(frame.column[order, j], about[i], column[order])
            if len(bends):
                _bend(column, bends[i, j])
            if columns.still[j] >= 0:
                for r in range(6):
                    static[i, r, columns.still[j]] += column[0, r]
            if columns.moving[j] >= 0:
                for order in range(3):
                    for r in range(6):
                        by[order, i, r, columns.moving[j]] += column[order, r]
        _centre_moves(left[i], slides, by[0, i])
        _by_ground(about[i], columns.first, columns.last, static[i])
        _by_bodies(tree, frame, rotation, translation, about[i], chain, columns.segments, static[i])
        _over_deviations(sd, i, left, static, by)
    return left, by


@part
def _over_deviations(sd: np.ndarray, i: int, left: np.ndarray, static: np.ndarray, by: np.ndarray) -> None:
    """Divide residuals and derivatives of frame i by their standard deviations."""
    for r in range(6):
        weight = 1.0 / sd[i, r]
        left[i, r] *= weight
        for k in range(static.shape[2]):
            static[i, r, k] *= weight
        for order in range(3):
            for k in range(by.shape[3]):
                by[order, i, r, k] *= weight


@part
def _bend(column: np.ndarray, bend: np.ndarray) -> None:
    """Convert derivatives (3, 6) by an axis' value, rate and acceleration to those by its coordinate's."""
    for r in range(6):
        place, rate, acceleration = column[0, r], column[1, r], column[2, r]
        column[0, r] = place * bend[0] + rate * bend[1] + acceleration * bend[2]
        column[1, r] = rate * bend[0] + acceleration * 2.0 * bend[1]
        column[2, r] = acceleration * bend[0]


@part
def _centre_moves(left: np.ndarray, slides: np.ndarray, by: np.ndarray) -> None:
    """Subtract the change of a load's (6,) moment due to its moving centre from the derivatives (6, c)."""
    for c in range(3):
        x, y, z = slides[c, 0], slides[c, 1], slides[c, 2]
        by[3, c] -= y * left[2] - z * left[1]
        by[4, c] -= z * left[0] - x * left[2]
        by[5, c] -= x * left[1] - y * left[0]


@part
def _by_ground(about: np.ndarray, first: int, last: int, static: np.ndarray) -> None:
    """Convert derivatives of the ground reactions at the ground origin to those of the residual about the centre."""
    x, y, z = about[0], about[1], about[2]
    for k in range(first, last):
        fx, fy, fz = static[0, k], static[1, k], static[2, k]
        static[0, k], static[1, k], static[2, k] = -fx, -fy, -fz
        static[3, k] = y * fz - z * fy - static[3, k]
        static[4, k] = z * fx - x * fz - static[4, k]
        static[5, k] = x * fy - y * fx - static[5, k]


@part
def _by_bodies(
    tree: KinematicTree,
    frame: Frame,
    rotation: np.ndarray,
    translation: np.ndarray,
    about: np.ndarray,
    chain: np.ndarray,
    segments: np.ndarray,
    static: np.ndarray,
) -> None:
    """Write derivatives by the bodies' unknowns to the first columns of `static` (6, s)."""
    w, e, b, own, by = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10)), np.empty((6, 10))
    for body in range(len(segments)):
        s = segments[body]
        carrier, turn = tree.carrier[s], rotation[s]
        if carrier < 0:
            continue
        in_segment(frame.velocity[carrier], frame.acceleration[carrier], turn, translation[s], w, e, b)
        own_regressor(w, e, b, own)
        by[:] = 0.0
        for r in range(6):
            # forces do not depend on moments of inertia, nor moments on the mass
            for k in range(0, 4) if r < 3 else range(1, 10):
                for c in range(10):
                    by[r, c] += own[r, k] * chain[body, k, c]
        x, y, z = translation[s, 0] - about[0], translation[s, 1] - about[1], translation[s, 2] - about[2]
        for c in range(10):
            k = 10 * body + c
            fx = turn[0, 0] * by[0, c] + turn[0, 1] * by[1, c] + turn[0, 2] * by[2, c]
            fy = turn[1, 0] * by[0, c] + turn[1, 1] * by[1, c] + turn[1, 2] * by[2, c]
            fz = turn[2, 0] * by[0, c] + turn[2, 1] * by[1, c] + turn[2, 2] * by[2, c]
            static[0, k], static[1, k], static[2, k] = fx, fy, fz
            static[3, k] = turn[0, 0] * by[3, c] + turn[0, 1] * by[4, c] + turn[0, 2] * by[5, c] + y * fz - z * fy
            static[4, k] = turn[1, 0] * by[3, c] + turn[1, 1] * by[4, c] + turn[1, 2] * by[5, c] + z * fx - x * fz
            static[5, k] = turn[2, 0] * by[3, c] + turn[2, 1] * by[4, c] + turn[2, 2] * by[5, c] + x * fy - y * fx
