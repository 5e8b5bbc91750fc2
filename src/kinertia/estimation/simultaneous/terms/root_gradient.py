"""Computes only the gradient of the root equations, without the derivatives of `root_columns`.

With L the residual over its variance, as a motion at the ground origin, and V, I, B, f, S, P, Q of `rigid_body`, the
contribution to an axis' position, rate and acceleration is

    L . (S x* f) + (L B) . P + (I L) . Q        (L B) . S + 2 (I L) . P        (I L) . S

L is the same for all axes: I L and L B = V x* (I L) - I (V x L) - L x* (I V) are summed over the bodies that an axis
moves, instead of I and B.
"""

import numpy as np

from kinertia.model.compiled import Float1, Float2, Float3, Int1, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, hand_down, place_segments
from kinertia.model.spatial import force_cross, inner, motion_cross
from kinertia.motion.regressor import in_segment
from kinertia.motion.rigid_body import Frame, bears, empty_frame, fill, inertia_times, taken_about, whole_load
from kinertia.motion.root_columns import Columns


@compiled
def add_root_gradient(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: Float2,
    motion: tuple[Float2, Float2, Float2],
    bends: Float3,
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
        tree, gravity_m_s2, bodies, motion, bends, root, wrench, sd, columns: as in `root_columns`.
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
    rotation, translation = np.empty((len(tree.carrier), 3, 3)), np.empty((len(tree.carrier), 3))
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
        _by_bodies(tree, frame, rotation, translation, by_ground[k], columns.segments, by_bodies)
        _of_bodies(tree.parent, bodies, frame, by_ground, k)
        _by_axes(frame, by_ground, k, by)
        for j in range(count):
            if len(bends):
                _bend(by[j], bends[k, j])
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
def _bend(by: np.ndarray, bend: np.ndarray) -> None:
    """Convert the gradient (3,) by an axis' value, rate and acceleration to that by its coordinate's."""
    place, rate, acceleration = by[0], by[1], by[2]
    by[0] = place * bend[0] + rate * bend[1] + acceleration * bend[2]
    by[1] = rate * bend[0] + acceleration * 2.0 * bend[1]
    by[2] = acceleration * bend[0]


@part
def _by_bodies(
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
        carrier, turn = tree.carrier[s], rotation[s]
        if carrier < 0:
            continue
        in_segment(frame.velocity[carrier], frame.acceleration[carrier], turn, translation[s], w, e, b)
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
