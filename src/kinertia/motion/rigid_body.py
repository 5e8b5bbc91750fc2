"""Computes loads of moving bodies and their derivatives, in compiled code; spatial vectors in ground axes.

A body of mass m, first moment H and moments of inertia J about the ground origin has the spatial inertia

    I = [[m 1, -[H]], [[H], J]]          [H] x = H x x, the cross product as a matrix

and, with velocity V = (v, w) and acceleration A (gravity included: the ground accelerates upwards), needs the load
f = I A + V x* (I V) (Featherstone 2008, eq. 5.9). Summed over all bodies that axis j moves, f, I and the matrix

    B = V x* I - I (V x) + (x* (I V)) = [[0, -2 [p]], [0, K]],     I V = (p, l)
    K = [w] J - J [w] - [v] [H] - [H] [v] - [l]

(twice the B of Singh, Russell and Wensing 2022, IEEE Robotics and Automation Letters 7:1776, eq. 8) give every
derivative in closed form. With S_j the axis, V and A of its parent, P = V x S_j and Q = A x S_j + V x P:

    d f / d place_j        = B P + I Q + S_j x* f
    d f / d rate_j         = B S_j + 2 I P
    d f / d acceleration_j = I S_j

The force of an axis is S_i . f_i. Its derivative by an axis j at or beyond it uses the sums over what j moves; by an
axis before it, the sums over what it moves itself, less S x* f, which cancels as its own direction rotates.
"""

from typing import NamedTuple

import numpy as np

from kinertia.model.compiled import Bool1, Float2, compiled, inlined, part
from kinertia.model.kinematic_tree import KinematicTree, force_cross, hand_down, inner, motion_cross, place_axes


class Frame(NamedTuple):
    """Quantities of one frame of a trial, axis by axis.

    Attributes:
        rotation, translation, axes: as in `place_axes`.
        velocity, acceleration: (a + 1, 6) of what the axis moves; the last row, -1, is the ground's.
        swept, turned: (a, 6) P and Q above.
        momentum: (a, 6) I V above, of bodies attached directly to the axis.
        inertia: (a, 13) m, H and J above, J row by row, of all bodies that the axis moves.
        bias: (a, 12) p and K above, K row by row, of the same.
        force: (a, 6) f above, of the same.
        column: (3, a, 6) derivatives of the force by the axis' value, rate and acceleration.
        spare: (3, a, 6) room for intermediate results.
    """

    rotation: np.ndarray
    translation: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    swept: np.ndarray
    turned: np.ndarray
    momentum: np.ndarray
    inertia: np.ndarray
    bias: np.ndarray
    force: np.ndarray
    column: np.ndarray
    spare: np.ndarray


@part
def empty_frame(a: int, gravity_m_s2: float) -> Frame:
    """Allocate one frame of this many axes."""
    six, more = (a, 6), (a + 1, 6)
    velocity, acceleration = np.zeros(more), np.zeros(more)
    acceleration[a, 1] = gravity_m_s2
    places = np.empty((a, 3, 3)), np.empty((a, 3)), np.empty(six)
    moved = velocity, acceleration, np.empty(six), np.empty(six), np.empty(six)
    sums = np.empty((a, 13)), np.empty((a, 12)), np.empty(six)
    return Frame(*places, *moved, *sums, np.empty((3, a, 6)), np.empty((3, a, 6)))


@part
def move(tree: KinematicTree, x: np.ndarray, v: np.ndarray, a: np.ndarray, frame: Frame) -> None:
    """Compute positions, velocities and accelerations in one frame, from those of the axes (a,)."""
    axes, velocity, acceleration = frame.axes, frame.velocity, frame.acceleration
    swept, turned = frame.swept, frame.turned
    place_axes(tree, x, frame.rotation, frame.translation, axes)
    twice = frame.spare[0]
    for j in range(len(x)):
        parent = tree.parent[j]
        motion_cross(velocity, parent, axes, j, swept, j)
        motion_cross(acceleration, parent, axes, j, turned, j)
        motion_cross(velocity, parent, swept, j, twice, j)
        for k in range(6):
            turned[j, k] += twice[j, k]
            velocity[j, k] = velocity[parent, k] + axes[j, k] * v[j]
            acceleration[j, k] = acceleration[parent, k] + axes[j, k] * a[j] + swept[j, k] * v[j]


@inlined
def _place_inertia(j: int, bodies: np.ndarray, frame: Frame) -> None:
    """Compute the inertia of bodies attached directly to axis j, at the ground origin, from its ten parameters."""
    rotation, at, inertia = frame.rotation, frame.translation, frame.inertia
    mass, hx, hy, hz = bodies[j, 0], bodies[j, 1], bodies[j, 2], bodies[j, 3]
    xx, xy, yy, xz, yz, zz = bodies[j, 4], bodies[j, 5], bodies[j, 6], bodies[j, 7], bodies[j, 8], bodies[j, 9]
    # J + 2 (t . h) - h t^T - t h^T + m (t . t - t t^T), with h the first moment about the frame and t its position
    round_about = 0.0
    for r in range(3):
        first = rotation[j, r, 0] * hx + rotation[j, r, 1] * hy + rotation[j, r, 2] * hz
        inertia[j, 1 + r] = first + mass * at[j, r]
        round_about += at[j, r] * (first + inertia[j, 1 + r])
    inertia[j, 0] = mass
    for r in range(3):
        x = rotation[j, r, 0] * xx + rotation[j, r, 1] * xy + rotation[j, r, 2] * xz
        y = rotation[j, r, 0] * xy + rotation[j, r, 1] * yy + rotation[j, r, 2] * yz
        z = rotation[j, r, 0] * xz + rotation[j, r, 1] * yz + rotation[j, r, 2] * zz
        for c in range(r, 3):
            value = x * rotation[j, c, 0] + y * rotation[j, c, 1] + z * rotation[j, c, 2]
            value += mass * at[j, r] * at[j, c] - inertia[j, 1 + r] * at[j, c] - at[j, r] * inertia[j, 1 + c]
            inertia[j, 4 + 3 * r + c] = value
            inertia[j, 4 + 3 * c + r] = value
        inertia[j, 4 + 4 * r] += round_about


@inlined
def inertia_times(inertia: np.ndarray, j: int, s: np.ndarray, i: int, out: np.ndarray, k: int) -> None:
    """Write I_j s[i] to out[k]."""
    m, x, y, z = inertia[j, 0], inertia[j, 1], inertia[j, 2], inertia[j, 3]
    lx, ly, lz, wx, wy, wz = s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4], s[i, 5]
    out[k, 0] = m * lx - (y * wz - z * wy)
    out[k, 1] = m * ly - (z * wx - x * wz)
    out[k, 2] = m * lz - (x * wy - y * wx)
    out[k, 3] = y * lz - z * ly + inertia[j, 4] * wx + inertia[j, 5] * wy + inertia[j, 6] * wz
    out[k, 4] = z * lx - x * lz + inertia[j, 7] * wx + inertia[j, 8] * wy + inertia[j, 9] * wz
    out[k, 5] = x * ly - y * lx + inertia[j, 10] * wx + inertia[j, 11] * wy + inertia[j, 12] * wz


@inlined
def _bias_times(bias: np.ndarray, j: int, s: np.ndarray, i: int, out: np.ndarray, k: int) -> None:
    """Write B_j s[i] to out[k]."""
    x, y, z = 2.0 * bias[j, 0], 2.0 * bias[j, 1], 2.0 * bias[j, 2]
    wx, wy, wz = s[i, 3], s[i, 4], s[i, 5]
    out[k, 0] = z * wy - y * wz
    out[k, 1] = x * wz - z * wx
    out[k, 2] = y * wx - x * wy
    out[k, 3] = bias[j, 3] * wx + bias[j, 4] * wy + bias[j, 5] * wz
    out[k, 4] = bias[j, 6] * wx + bias[j, 7] * wy + bias[j, 8] * wz
    out[k, 5] = bias[j, 9] * wx + bias[j, 10] * wy + bias[j, 11] * wz


@inlined
def times_bias(bias: np.ndarray, j: int, s: np.ndarray, i: int, out: np.ndarray, k: int) -> None:
    """Write s[i] B_j to out[k]."""
    x, y, z = 2.0 * bias[j, 0], 2.0 * bias[j, 1], 2.0 * bias[j, 2]
    lx, ly, lz, wx, wy, wz = s[i, 0], s[i, 1], s[i, 2], s[i, 3], s[i, 4], s[i, 5]
    out[k, 0] = 0.0
    out[k, 1] = 0.0
    out[k, 2] = 0.0
    out[k, 3] = bias[j, 3] * wx + bias[j, 6] * wy + bias[j, 9] * wz - (ly * z - lz * y)
    out[k, 4] = bias[j, 4] * wx + bias[j, 7] * wy + bias[j, 10] * wz - (lz * x - lx * z)
    out[k, 5] = bias[j, 5] * wx + bias[j, 8] * wy + bias[j, 11] * wz - (lx * y - ly * x)


@part
def _place_bias(j: int, velocity: np.ndarray, inertia: np.ndarray, momentum: np.ndarray, bias: np.ndarray) -> None:
    """Compute B of bodies attached directly to axis j."""
    x, y, z = velocity[j, 3], velocity[j, 4], velocity[j, 5]
    for c in range(3):
        sx, sy, sz = inertia[j, 4 + c], inertia[j, 7 + c], inertia[j, 10 + c]
        bias[j, 3 + c], bias[j, 6 + c], bias[j, 9 + c] = y * sz - z * sy, z * sx - x * sz, x * sy - y * sx
    # [w] J - J [w] is that and its transpose, [v] [H] + [H] [v] = v H^T + H v^T - 2 (v . H) 1
    twice = 0.0
    for r in range(3):
        bias[j, r] = momentum[j, r]
        twice += 2.0 * velocity[j, r] * inertia[j, 1 + r]
    for r in range(3):
        for c in range(r, 3):
            value = bias[j, 3 + 3 * r + c] + bias[j, 3 + 3 * c + r]
            value -= inertia[j, 1 + r] * velocity[j, c] + velocity[j, r] * inertia[j, 1 + c]
            bias[j, 3 + 3 * r + c] = value
            bias[j, 3 + 3 * c + r] = value
        bias[j, 3 + 4 * r] += twice
    bias[j, 4] += momentum[j, 5]
    bias[j, 5] -= momentum[j, 4]
    bias[j, 6] -= momentum[j, 5]
    bias[j, 8] += momentum[j, 3]
    bias[j, 9] += momentum[j, 4]
    bias[j, 10] -= momentum[j, 3]


@part
def _columns(frame: Frame) -> None:
    """Compute the derivatives `column` from everything else in the frame."""
    axes, swept, inertia, bias = frame.axes, frame.swept, frame.inertia, frame.bias
    (place, rate, acceleration), (by_swept, by_turned, twice) = frame.column, frame.spare
    for j in range(len(axes)):
        force_cross(axes, j, frame.force, j, place, j)
        _bias_times(bias, j, swept, j, by_swept, j)
        inertia_times(inertia, j, frame.turned, j, by_turned, j)
        _bias_times(bias, j, axes, j, rate, j)
        inertia_times(inertia, j, swept, j, twice, j)
        inertia_times(inertia, j, axes, j, acceleration, j)
        for k in range(6):
            place[j, k] += by_swept[j, k] + by_turned[j, k]
            rate[j, k] += 2.0 * twice[j, k]


@inlined
def bears(bodies: np.ndarray, j: int) -> bool:
    """Decide whether a body is attached directly to axis j."""
    borne = False
    for k in range(10):
        borne = borne or bodies[j, k] != 0.0
    return borne


@part
def fill(tree: KinematicTree, bodies: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray, frame: Frame) -> None:
    """Compute motion and forces of one frame, from bodies (a, 10) and x, v, a (a,) as in `axis_forces`.

    The inertia is that of bodies attached directly to each axis.
    """
    move(tree, x, v, a, frame)
    inertia, momentum, force = frame.inertia, frame.momentum, frame.force
    second = frame.spare[0]
    force[:] = 0.0
    inertia[:] = 0.0
    for j in range(len(bodies)):
        if bears(bodies, j):
            _place_inertia(j, bodies, frame)
            inertia_times(inertia, j, frame.velocity, j, momentum, j)
            inertia_times(inertia, j, frame.acceleration, j, force, j)
            force_cross(frame.velocity, j, momentum, j, second, j)
            for k in range(6):
                force[j, k] += second[j, k]
    hand_down(tree.parent, force)


@part
def differentiate(tree: KinematicTree, bodies: np.ndarray, frame: Frame) -> None:
    """Compute inertia and bias of all bodies that the axes move, and the derivatives `column`, after `fill`."""
    frame.bias[:] = 0.0
    for j in range(len(bodies)):
        if bears(bodies, j):
            _place_bias(j, frame.velocity, frame.inertia, frame.momentum, frame.bias)
    hand_down(tree.parent, frame.inertia)
    hand_down(tree.parent, frame.bias)
    _columns(frame)


@inlined
def taken_about(force: np.ndarray, about: np.ndarray, out: np.ndarray) -> None:
    """Write a force, and its moment about another point than the ground origin, to `out` (6,)."""
    fx, fy, fz, x, y, z = force[0], force[1], force[2], about[0], about[1], about[2]
    out[0], out[1], out[2] = fx, fy, fz
    out[3], out[4], out[5] = force[3] - (y * fz - z * fy), force[4] - (z * fx - x * fz), force[5] - (x * fy - y * fx)


@part
def whole_load(parent: np.ndarray, force: np.ndarray, out: np.ndarray, k: int) -> None:
    """Add the forces (6,) of the axes that are attached to the ground to out[k]."""
    for j in range(len(parent)):
        if parent[j] < 0:
            for r in range(6):
                out[k, r] += force[j, r]


@compiled
def axis_forces(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: Float2,
    x: Float2,
    v: Float2,
    a: Float2,
    about: Float2,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the forces of all axes, the load of the whole body, and its derivatives by the root's accelerations.

    Args:
        tree: the skeleton.
        gravity_m_s2: downward, along -y.
        bodies: (a, 10) parameters of bodies attached directly to each axis, in its frame.
        x, v, a: (n, a) values, rates and accelerations of the axes.
        about: (n, 3) m, the point of the moment in the derivatives.

    Returns:
        (n, a) forces; (n, 6) force, and moment about the ground origin, ground axes; and (n, 6, 6) derivatives by a of
        the first six axes, the root's, of the force, and of the moment about the other point.
    """
    n, count = x.shape
    root = min(6, count)
    tau, load, by = np.empty((n, count)), np.zeros((n, 6)), np.empty((n, 6, root))
    frame = empty_frame(count, gravity_m_s2)
    inertia, column = frame.inertia, frame.spare[0]
    for k in range(n):
        fill(tree, bodies, x[k], v[k], a[k], frame)
        hand_down(tree.parent, inertia)
        for j in range(root):
            inertia_times(inertia, j, frame.axes, j, column, j)
            taken_about(column[j], about[k], by[k, :, j])
        _sum_up(tree.parent, frame, tau, load, k)
    return tau, load, by


@part
def _sum_up(parent: np.ndarray, frame: Frame, tau: np.ndarray, load: np.ndarray, k: int) -> None:
    """Write the forces of the axes to tau[k], and add the load of the whole body to load[k]."""
    for j in range(len(parent)):
        tau[k, j] = inner(frame.axes, j, frame.force, j)
    whole_load(parent, frame.force, load, k)


@compiled
def axis_force_derivatives(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: Float2,
    x: Float2,
    v: Float2,
    a: Float2,
    about: Float2,
    moving: Bool1,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Compute the forces of all axes and the load of the whole body, and their derivatives.

    Args:
        tree, gravity_m_s2, bodies, x, v, a, about: as in `axis_forces`; the derivatives ignore that the point `about`
            moves with the axes.
        moving: (a,) axes whose forces are differentiated.

    Returns:
        (n, a) forces, (n, 6) load, and their derivatives by x, v and a, (3, n, a, a) and (3, n, 6, a). Those of forces
        are zero for axes that are not `moving`, and by the v and a of these axes; if none is, they are (3, n, 0, 0).
    """
    n, count = x.shape
    some = count if moving.any() else 0
    tau, by = np.empty((n, count)), np.zeros((3, n, some, some))
    load, by_load = np.zeros((n, 6)), np.empty((3, n, 6, count))
    frame = empty_frame(count, gravity_m_s2)
    for k in range(n):
        fill(tree, bodies, x[k], v[k], a[k], frame)
        differentiate(tree, bodies, frame)
        _sum_up(tree.parent, frame, tau, load, k)
        for j in range(count):
            for order in range(3):
                taken_about(frame.column[order, j], about[k], by_load[order, k, :, j])
        if some > 0:
            _through_axes(tree.parent, moving, frame, (by[0, k], by[1, k], by[2, k]))
    return tau, load, by, by_load


@part
def _through_axes(parent: np.ndarray, moving: np.ndarray, frame: Frame, by: tuple[np.ndarray, ...]) -> None:
    """Compute derivatives (a, a) of axis forces by values, rates and accelerations, from those of the bodies moved."""
    axes, swept, turned, inertia, bias = frame.axes, frame.swept, frame.turned, frame.inertia, frame.bias
    (place, rate, acceleration), column, biased, borne = by, frame.column, frame.spare[0], frame.spare[1]
    for j in range(len(parent)):
        i = j
        while i >= 0:
            if moving[i]:
                place[i, j] = inner(axes, i, column[0], j)
                if moving[j]:
                    rate[i, j] = inner(axes, i, column[1], j)
                    acceleration[i, j] = inner(axes, i, column[2], j)
            i = parent[i]
        if not moving[j]:
            continue
        times_bias(bias, j, axes, j, biased, j)
        inertia_times(inertia, j, axes, j, borne, j)
        i = parent[j]
        while i >= 0:
            place[j, i] = inner(biased, j, swept, i) + inner(borne, j, turned, i)
            if moving[i]:
                rate[j, i] = inner(biased, j, axes, i) + 2.0 * inner(borne, j, swept, i)
                acceleration[j, i] = inner(borne, j, axes, i)
            i = parent[i]
