"""Computes the root equations, all their derivatives, or their gradient only, in compiled code.

With L the residual over its variance, as a motion at the ground origin, and V, I, B, f, S, P, Q of `rigid_body`, the
contribution to an axis' position, rate and acceleration is

    L . (S x* f) + (L B) . P + (I L) . Q        (L B) . S + 2 (I L) . P        (I L) . S

L is the same for all axes: I L and L B = V x* (I L) - I (V x L) - L x* (I V) are summed over the bodies that an axis
moves, instead of I and B.

They equal those of `residual_terms` and `root_regressor` of `dynamics`, for coordinates that move, for some that do
not, for the bodies and for the ground reactions, but are computed in one pass and only as far as needed.
"""

from typing import NamedTuple

import numpy as np

from kinertia.model.compiled import Float1, Float2, Float3, Int1, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, force_cross, hand_down, inner, motion_cross, place_segments
from kinertia.motion.dynamics import in_segment, own_regressor
from kinertia.motion.rigid_body import (
    Frame,
    bears,
    differentiate,
    empty_frame,
    fill,
    inertia_times,
    taken_about,
    whole_load,
)


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
    by_coordinate: Float3,
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
        by_coordinate: (n, a, 3) dependence of axes on coordinates, `CoordinateMap.chain`; n is 0 if each axis is its
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
    rotation, translation = np.empty((len(tree.last_axis), 3, 3)), np.empty((len(tree.last_axis), 3))
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
            if len(by_coordinate):
                _columns_by_coordinate(column, by_coordinate[i, j])
            if columns.still[j] >= 0:
                for r in range(6):
                    static[i, r, columns.still[j]] += column[0, r]
            if columns.moving[j] >= 0:
                for order in range(3):
                    for r in range(6):
                        by[order, i, r, columns.moving[j]] += column[order, r]
        _centre_moves(left[i], slides, by[0, i])
        _by_ground(about[i], columns.first, columns.last, static[i])
        _columns_by_bodies(tree, frame, rotation, translation, about[i], chain, columns.segments, static[i])
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
def _columns_by_coordinate(column: np.ndarray, chain: np.ndarray) -> None:
    """Convert derivatives (3, 6) by an axis' value, rate and acceleration to those by its coordinate's."""
    for r in range(6):
        place, rate, acceleration = column[0, r], column[1, r], column[2, r]
        column[0, r] = place * chain[0] + rate * chain[1] + acceleration * chain[2]
        column[1, r] = rate * chain[0] + acceleration * 2.0 * chain[1]
        column[2, r] = acceleration * chain[0]


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
def _columns_by_bodies(
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
    w, e, b, by_body, by = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10)), np.empty((6, 10))
    for body in range(len(segments)):
        s = segments[body]
        last_axis, turn = tree.last_axis[s], rotation[s]
        if last_axis < 0:
            continue
        in_segment(frame.velocity[last_axis], frame.acceleration[last_axis], turn, translation[s], w, e, b)
        own_regressor(w, e, b, by_body)
        by[:] = 0.0
        for r in range(6):
            # forces do not depend on moments of inertia, nor moments on the mass
            for k in range(0, 4) if r < 3 else range(1, 10):
                for c in range(10):
                    by[r, c] += by_body[r, k] * chain[body, k, c]
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


@compiled
def add_root_gradient(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: Float2,
    motion: tuple[Float2, Float2, Float2],
    by_coordinate: Float3,
    root: tuple[Float2, Float2],
    wrench: Float2,
    sd: Float2,
    columns: Columns,
    basis: tuple[Int1, Float3],
    rhs: Float2,
    static_rhs: Float1,
) -> tuple[float, np.ndarray, np.ndarray]:
    """Add minus the gradient of half the sum of squares by the motion (size, c) and by static coordinates (S,).

    Args:
        tree, gravity_m_s2, bodies, motion, by_coordinate, root, wrench, sd, columns: as in `root_columns`.
        basis: (n,) the first active spline of each frame among those of `rhs`, and (3, n, 6) values of the active
            ones and their first two derivatives.
        rhs, static_rhs: arrays to which it is added.

    Returns:
        Half the sum of squares; its derivatives by the parameters of each segment's body (b, 10); and minus those by
        the ground reactions (n, 6), force and moment at the ground origin.
    """
    (x, v, a), (about, slides), (first, values) = motion, root, basis
    n, count = x.shape
    cost, by_bodies, by_ground = 0.0, np.zeros((len(columns.segments), 10)), np.empty((n, 6))
    frame, left, load = empty_frame(count, gravity_m_s2), np.empty(6), np.zeros((1, 6))
    pull, by = np.empty(6), np.empty((count, 3))
    rotation, translation = np.empty((len(tree.last_axis), 3, 3)), np.empty((len(tree.last_axis), 3))
    for k in range(n):
        fill(tree, bodies, x[k], v[k], a[k], frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        load[:] = 0.0
        whole_load(tree.parent, frame.force, load, 0)
        for r in range(6):
            load[0, r] -= wrench[k, r]
        taken_about(load[0], about[k], left)
        for r in range(6):
            pull[r] = left[r] / (sd[k, r] * sd[k, r])
            cost += 0.5 * left[r] * pull[r]
            by_ground[k, r] = pull[r]
        _at_origin(by_ground[k], about[k])
        _moving_centre(left, pull, slides, first[k], values[0, k], rhs)
        _gradient_by_bodies(tree, frame, rotation, translation, by_ground[k], columns.segments, by_bodies)
        _of_bodies(tree.parent, bodies, frame, by_ground, k)
        _by_axes(frame, by_ground, k, by)
        for j in range(count):
            if len(by_coordinate):
                _gradient_by_coordinate(by[j], by_coordinate[k, j])
            if columns.still[j] >= 0:
                static_rhs[columns.still[j]] -= by[j, 0]
            if columns.moving[j] >= 0:
                for i in range(6):
                    along = values[0, k, i] * by[j, 0] + values[1, k, i] * by[j, 1] + values[2, k, i] * by[j, 2]
                    rhs[first[k] + i, columns.moving[j]] -= along
    return cost, by_bodies, by_ground


@part
def _at_origin(pull: np.ndarray, about: np.ndarray) -> None:
    """Convert the gradient (6,) by a force and its moment about a point into that by the wrench at the origin."""
    x, y, z = about[0], about[1], about[2]
    pull[0] -= pull[4] * z - pull[5] * y
    pull[1] -= pull[5] * x - pull[3] * z
    pull[2] -= pull[3] * y - pull[4] * x


@part
def _moving_centre(
    left: np.ndarray, pull: np.ndarray, slides: np.ndarray, first: int, values: np.ndarray, rhs: np.ndarray
) -> None:
    """Add the change of the moment because its centre moves with the first three coordinates."""
    for c in range(3):
        x, y, z = slides[c, 0], slides[c, 1], slides[c, 2]
        by = (y * left[2] - z * left[1]) * pull[3]
        by += (z * left[0] - x * left[2]) * pull[4] + (x * left[1] - y * left[0]) * pull[5]
        for i in range(6):
            rhs[first + i, c] += values[i] * by


@part
def _of_bodies(parent: np.ndarray, bodies: np.ndarray, frame: Frame, pulls: np.ndarray, k: int) -> None:
    """Write I L and L B, summed over the bodies that each axis moves, to the first two of `spare`; L is pulls[k]."""
    velocity, inertia, momentum = frame.velocity, frame.inertia, frame.momentum
    borne, biased, force = frame.spare[0], frame.spare[1], frame.spare[2]
    swept = np.empty((1, 6))
    borne[:] = 0.0
    biased[:] = 0.0
    for j in range(len(bodies)):
        if bears(bodies, j):
            inertia_times(inertia, j, pulls, k, borne, j)
            force_cross(velocity, j, borne, j, biased, j)
            motion_cross(velocity, j, pulls, k, swept, 0)
            inertia_times(inertia, j, swept, 0, force, j)
            for r in range(6):
                biased[j, r] -= force[j, r]
            force_cross(pulls, k, momentum, j, force, j)
            for r in range(6):
                biased[j, r] -= force[j, r]
    hand_down(parent, borne)
    hand_down(parent, biased)


@part
def _by_axes(frame: Frame, pulls: np.ndarray, k: int, by: np.ndarray) -> None:
    """Write the gradient (a, 3) by position, rate and acceleration of the axes, for pulls[k] on the load, to `by`."""
    axes, swept, turned, force = frame.axes, frame.swept, frame.turned, frame.force
    borne, biased, turning = frame.spare[0], frame.spare[1], frame.spare[2]
    for j in range(len(by)):
        force_cross(axes, j, force, j, turning, j)
        by[j, 0] = inner(turning, j, pulls, k) + inner(biased, j, swept, j) + inner(borne, j, turned, j)
        by[j, 1] = inner(biased, j, axes, j) + 2.0 * inner(borne, j, swept, j)
        by[j, 2] = inner(borne, j, axes, j)


@part
def _gradient_by_coordinate(by: np.ndarray, chain: np.ndarray) -> None:
    """Convert the gradient (3,) by an axis' value, rate and acceleration to that by its coordinate's."""
    place, rate, acceleration = by[0], by[1], by[2]
    by[0] = place * chain[0] + rate * chain[1] + acceleration * chain[2]
    by[1] = rate * chain[0] + acceleration * 2.0 * chain[1]
    by[2] = acceleration * chain[0]


@part
def _gradient_by_bodies(
    tree: KinematicTree,
    frame: Frame,
    rotation: np.ndarray,
    translation: np.ndarray,
    pull: np.ndarray,
    segments: np.ndarray,
    by_bodies: np.ndarray,
) -> None:
    """Add the gradient (b, 10) by the bodies' parameters, for the gradient (6,) by the load at the ground origin."""
    w, e, b = np.empty(3), np.empty(3), np.empty(3)
    for body in range(len(segments)):
        s = segments[body]
        last_axis, turn = tree.last_axis[s], rotation[s]
        if last_axis < 0:
            continue
        in_segment(frame.velocity[last_axis], frame.acceleration[last_axis], turn, translation[s], w, e, b)
        # at the segment's origin, in its axes
        x, y, z = translation[s, 0], translation[s, 1], translation[s, 2]
        fx = pull[0] + pull[4] * z - pull[5] * y
        fy = pull[1] + pull[5] * x - pull[3] * z
        fz = pull[2] + pull[3] * y - pull[4] * x
        force = (
            turn[0, 0] * fx + turn[1, 0] * fy + turn[2, 0] * fz,
            turn[0, 1] * fx + turn[1, 1] * fy + turn[2, 1] * fz,
            turn[0, 2] * fx + turn[1, 2] * fy + turn[2, 2] * fz,
        )
        moment = (
            turn[0, 0] * pull[3] + turn[1, 0] * pull[4] + turn[2, 0] * pull[5],
            turn[0, 1] * pull[3] + turn[1, 1] * pull[4] + turn[2, 1] * pull[5],
            turn[0, 2] * pull[3] + turn[1, 2] * pull[4] + turn[2, 2] * pull[5],
        )
        _add_transposed(w, e, b, force, moment, by_bodies[body])


@part
def _add_transposed(
    w: np.ndarray,
    e: np.ndarray,
    b: np.ndarray,
    force: tuple[float, float, float],
    moment: tuple[float, float, float],
    out: np.ndarray,
) -> None:
    """Add the transposed `regressor.own_regressor` times a gradient by force and moment to `out` (10,)."""
    (x, y, z), (mx, my, mz) = force, moment
    wx, wy, wz, ex, ey, ez, bx, by, bz = w[0], w[1], w[2], e[0], e[1], e[2], b[0], b[1], b[2]
    along, square = wx * x + wy * y + wz * z, wx * wx + wy * wy + wz * wz
    out[0] += bx * x + by * y + bz * z
    out[1] += y * ez - z * ey + wx * along - x * square + by * mz - bz * my
    out[2] += z * ex - x * ez + wy * along - y * square + bz * mx - bx * mz
    out[3] += x * ey - y * ex + wz * along - z * square + bx * my - by * mx
    # the moments of inertia give (moment) . I e + (moment x w) . I w
    ux, uy, uz = my * wz - mz * wy, mz * wx - mx * wz, mx * wy - my * wx
    out[4] += mx * ex + ux * wx
    out[5] += mx * ey + my * ex + ux * wy + uy * wx
    out[6] += my * ey + uy * wy
    out[7] += mx * ez + mz * ex + ux * wz + uz * wx
    out[8] += my * ez + mz * ey + uy * wz + uz * wy
    out[9] += mz * ez + uz * wz
