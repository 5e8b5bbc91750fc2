"""Loads of moving bodies and their derivatives, frame by frame in compiled code; spatial vectors in ground axes.

A body with velocity V, acceleration A (gravity included: the ground accelerates upwards) and spatial inertia I needs
the load f = I A + V x* (I V) (Featherstone 2008, eq. 5.9). Summed over all that axis j carries, f, I and

    B = 2 [V x* I - I V x] with the momentum's own part, i.e. twice the B of Singh, Russell and Wensing 2022
    (IEEE Robotics and Automation Letters 7:1776, eq. 8)

give every derivative in closed form. With S_j the axis, V and A of its parent, P = V x S_j and Q = A x S_j + V x P:

    d f / d place_j        = B P + I Q + S_j x* f
    d f / d rate_j         = B S_j + 2 I P
    d f / d acceleration_j = I S_j

The force of an axis is S_i . f_i. It answers to an axis j that it carries, or is, by the sums over what j carries; to
an axis before it by the sums over what it carries itself, of which the term S x* f cancels, since its own direction
turns along.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.model.compiled import compiled
from kinertia.model.kinematic_tree import KinematicTree, place_axes, place_segments
from kinertia.model.spatial import force_cross, inner, motion_cross, times, transposed_times


class _Frame(NamedTuple):
    """One frame of a trial, axis by axis.

    Attributes:
        rotation, translation, axes: as `place_axes` has them.
        velocity, acceleration: (a, 6) of what the axis moves.
        swept, turned: (a, 6) P and Q above.
        inertia, bias, force: (a, 6, 6), (a, 6, 6), (a, 6): I, B and f above.
    """

    rotation: np.ndarray
    translation: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    swept: np.ndarray
    turned: np.ndarray
    inertia: np.ndarray
    bias: np.ndarray
    force: np.ndarray


@compiled
def _empty(a: int) -> _Frame:
    """Room for one frame of this many axes."""
    six, square = (a, 6), (a, 6, 6)
    return _Frame(
        np.empty((a, 3, 3)),
        np.empty((a, 3)),
        np.empty(six),
        np.empty(six),
        np.empty(six),
        np.empty(six),
        np.empty(six),
        np.empty(square),
        np.empty(square),
        np.empty(six),
    )


@compiled
def _move(tree: KinematicTree, gravity_m_s2: float, x: np.ndarray, v: np.ndarray, a: np.ndarray, frame: _Frame) -> None:
    """Places, velocities and accelerations in one frame, from places, rates and accelerations of the axes (a,)."""
    place_axes(tree, x, frame.rotation, frame.translation, frame.axes)
    ground, lifted, twice = np.zeros(6), np.zeros(6), np.empty(6)
    lifted[1] = gravity_m_s2
    for j in range(len(x)):
        parent, axis, swept, turned = tree.parent[j], frame.axes[j], frame.swept[j], frame.turned[j]
        velocity = ground if parent < 0 else frame.velocity[parent]
        acceleration = lifted if parent < 0 else frame.acceleration[parent]
        motion_cross(velocity, axis, swept)
        motion_cross(acceleration, axis, turned)
        motion_cross(velocity, swept, twice)
        for k in range(6):
            turned[k] += twice[k]
            frame.velocity[j, k] = velocity[k] + axis[k] * v[j]
            frame.acceleration[j, k] = acceleration[k] + axis[k] * a[j] + swept[k] * v[j]


@compiled
def _place_inertia(rotation: np.ndarray, at: np.ndarray, body: np.ndarray, out: np.ndarray) -> None:
    """out = (6, 6) spatial inertia at the ground origin of the ten parameters of a body in a frame there."""
    mass = body[0]
    first, own, half = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    own[0, 0], own[0, 1], own[0, 2] = body[4], body[5], body[7]
    own[1, 0], own[1, 1], own[1, 2] = body[5], body[6], body[8]
    own[2, 0], own[2, 1], own[2, 2] = body[7], body[8], body[9]
    for r in range(3):
        first[r] = rotation[r, 0] * body[1] + rotation[r, 1] * body[2] + rotation[r, 2] * body[3]
        for c in range(3):
            half[r, c] = rotation[r, 0] * own[0, c] + rotation[r, 1] * own[1, c] + rotation[r, 2] * own[2, c]
    # I + 2 (p . h) - h p^T - p h^T + m (p . p - p p^T), with h the first moment and p the place
    ph = at[0] * first[0] + at[1] * first[1] + at[2] * first[2]
    pp = at[0] * at[0] + at[1] * at[1] + at[2] * at[2]
    out[:] = 0.0
    for r in range(3):
        for c in range(3):
            turned = half[r, 0] * rotation[c, 0] + half[r, 1] * rotation[c, 1] + half[r, 2] * rotation[c, 2]
            out[3 + r, 3 + c] = turned - first[r] * at[c] - at[r] * first[c] - mass * at[r] * at[c]
        out[3 + r, 3 + r] += 2.0 * ph + mass * pp
        out[r, r] = mass
    x, y, z = first[0] + mass * at[0], first[1] + mass * at[1], first[2] + mass * at[2]
    out[0, 4], out[1, 3], out[0, 5], out[2, 3], out[1, 5], out[2, 4] = z, -z, -y, y, x, -x
    out[4, 0], out[3, 1], out[5, 0], out[3, 2], out[5, 1], out[4, 2] = z, -z, -y, y, x, -x


@compiled
def _place_bias(velocity: np.ndarray, inertia: np.ndarray, momentum: np.ndarray, out: np.ndarray) -> None:
    """out = (6, 6) B of one body: m -> V x* (I m) - I (V x m) + m x* (I V)."""
    unit, crossed, mapped = np.empty(6), np.empty(6), np.empty(6)
    for c in range(6):
        unit[:] = 0.0
        unit[c] = 1.0
        force_cross(velocity, inertia[:, c], crossed)
        out[:, c] = crossed
        motion_cross(velocity, unit, crossed)
        times(inertia, crossed, mapped)
        for r in range(6):
            out[r, c] -= mapped[r]
        force_cross(unit, momentum, crossed)
        for r in range(6):
            out[r, c] += crossed[r]


@compiled
def _load(bodies: np.ndarray, frame: _Frame, derivatives: bool) -> None:
    """Force, and inertia and bias if there are to be derivatives, of what each axis itself bears: bodies (a, 10)."""
    momentum, second = np.empty(6), np.empty(6)
    for j in range(len(bodies)):
        force = frame.force[j]
        if not bodies[j].any():
            force[:] = 0.0
            frame.inertia[j] = 0.0
            frame.bias[j] = 0.0
            continue
        inertia, velocity = frame.inertia[j], frame.velocity[j]
        _place_inertia(frame.rotation[j], frame.translation[j], bodies[j], inertia)
        times(inertia, velocity, momentum)
        times(inertia, frame.acceleration[j], force)
        force_cross(velocity, momentum, second)
        for k in range(6):
            force[k] += second[k]
        if derivatives:
            _place_bias(velocity, inertia, momentum, frame.bias[j])


@compiled
def _hand_down(parent: int, j: int, frame: _Frame, derivatives: bool) -> None:
    """Add what axis j carries to what its parent carries."""
    for r in range(6):
        frame.force[parent, r] += frame.force[j, r]
        if derivatives:
            for c in range(6):
                frame.inertia[parent, r, c] += frame.inertia[j, r, c]
                frame.bias[parent, r, c] += frame.bias[j, r, c]


@compiled
def _columns(j: int, frame: _Frame, by: np.ndarray) -> None:
    """by = (3, 6) derivatives of the load by place, rate and acceleration of axis j, which has its sums by now."""
    axis, swept, turned = frame.axes[j], frame.swept[j], frame.turned[j]
    inertia, bias = frame.inertia[j], frame.bias[j]
    force_cross(axis, frame.force[j], by[0])
    for r in range(6):
        place, rate, acceleration = 0.0, 0.0, 0.0
        for k in range(6):
            place += bias[r, k] * swept[k] + inertia[r, k] * turned[k]
            rate += bias[r, k] * axis[k] + 2.0 * inertia[r, k] * swept[k]
            acceleration += inertia[r, k] * axis[k]
        by[0, r] += place
        by[1, r], by[2, r] = rate, acceleration


@compiled
def root_load(
    tree: KinematicTree,
    gravity_m_s2: float,
    bodies: np.ndarray,
    x: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    about: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Load of the whole body and its derivatives.

    Args:
        tree: the skeleton.
        gravity_m_s2: downward, along -y.
        bodies: (a, 10) parameters of what each axis itself bears, in its frame.
        x, v, a: (n, a) places, rates and accelerations of the axes.
        about: (n, 3) m, the point of the moment; its motion with the axes is left out of the derivatives.

    Returns:
        (n, 6) force and moment, ground axes, and (3, n, 6, a) their derivatives by x, v and a.
    """
    n, count = x.shape
    load, by = np.zeros((n, 6)), np.empty((3, n, 6, count))
    frame, column = _empty(count), np.empty((3, 6))
    for k in range(n):
        _move(tree, gravity_m_s2, x[k], v[k], a[k], frame)
        _load(bodies, frame, True)
        for j in range(count - 1, -1, -1):
            _columns(j, frame, column)
            for order in range(3):
                _shift(column[order], about[k])
                by[order, k, :, j] = column[order]
            if tree.parent[j] < 0:
                load[k] += frame.force[j]
            else:
                _hand_down(tree.parent[j], j, frame, True)
        _shift(load[k], about[k])
    return load, by


@compiled
def _shift(force: np.ndarray, to: np.ndarray) -> None:
    """Take the moment of a force (6,) about another point than the origin, in place."""
    force[3] -= to[1] * force[2] - to[2] * force[1]
    force[4] -= to[2] * force[0] - to[0] * force[2]
    force[5] -= to[0] * force[1] - to[1] * force[0]


@compiled
def axis_forces(
    tree: KinematicTree, gravity_m_s2: float, bodies: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n, a) forces of all axes that move the bodies so, and (n, 6) their load at the ground origin; as `root_load`."""
    n, count = x.shape
    tau, load = np.empty((n, count)), np.zeros((n, 6))
    frame = _empty(count)
    for k in range(n):
        _move(tree, gravity_m_s2, x[k], v[k], a[k], frame)
        _load(bodies, frame, False)
        for j in range(count - 1, -1, -1):
            tau[k, j] = inner(frame.axes[j], frame.force[j])
            if tree.parent[j] < 0:
                load[k] += frame.force[j]
            else:
                _hand_down(tree.parent[j], j, frame, False)
    return tau, load


@compiled
def axis_force_derivatives(
    tree: KinematicTree, gravity_m_s2: float, bodies: np.ndarray, x: np.ndarray, v: np.ndarray, a: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n, a) as `axis_forces` and (3, n, a, a) their derivatives by x, v and a (columns)."""
    n, count = x.shape
    tau, by = np.empty((n, count)), np.zeros((3, n, count, count))
    frame, column = _empty(count), np.empty((3, 6))
    through_bias, through_inertia = np.empty(6), np.empty(6)
    for k in range(n):
        _move(tree, gravity_m_s2, x[k], v[k], a[k], frame)
        _load(bodies, frame, True)
        for j in range(count - 1, -1, -1):
            axis = frame.axes[j]
            tau[k, j] = inner(axis, frame.force[j])
            _columns(j, frame, column)
            for order in range(3):
                by[order, k, j, j] = inner(axis, column[order])
            transposed_times(frame.bias[j], axis, through_bias)
            times(frame.inertia[j], axis, through_inertia)
            i = tree.parent[j]
            if i >= 0:
                _hand_down(i, j, frame, True)
            while i >= 0:
                before, swept = frame.axes[i], frame.swept[i]
                for order in range(3):
                    by[order, k, i, j] = inner(before, column[order])
                by[0, k, j, i] = inner(through_bias, swept) + inner(through_inertia, frame.turned[i])
                by[1, k, j, i] = inner(through_bias, before) + 2.0 * inner(through_inertia, swept)
                by[2, k, j, i] = inner(through_inertia, before)
                i = tree.parent[i]
    return tau, by


@compiled
def regressor(
    tree: KinematicTree, gravity_m_s2: float, x: np.ndarray, v: np.ndarray, a: np.ndarray, about: np.ndarray
) -> np.ndarray:
    """(n, 6, s, 10) load of every segment per unit of its ten parameters, in its own frame; else as `root_load`.

    With w, e and b the angular velocity, angular acceleration and acceleration of the origin in the segment's axes,
    mass m, first moment h and inertia I need the force m b + e x h + w x (w x h) and, about the segment's origin, the
    moment h x b + I e + w x (I w).
    """
    n, count = x.shape
    segments = len(tree.carrier)
    result = np.zeros((n, 6, segments, 10))
    frame = _empty(count)
    rotation, translation = np.empty((segments, 3, 3)), np.empty((segments, 3))
    w, e, b, own = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10))
    for k in range(n):
        _move(tree, gravity_m_s2, x[k], v[k], a[k], frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        for s in range(segments):
            carrier = tree.carrier[s]
            if carrier < 0:
                continue
            _in_segment(frame.velocity[carrier], frame.acceleration[carrier], rotation[s], translation[s], w, e, b)
            _own_regressor(w, e, b, own)
            _to_ground(rotation[s], translation[s] - about[k], own, result[k, :, s])
    return result


@compiled
def _in_segment(
    velocity: np.ndarray,
    acceleration: np.ndarray,
    rotation: np.ndarray,
    at: np.ndarray,
    w: np.ndarray,
    e: np.ndarray,
    b: np.ndarray,
) -> None:
    """Angular velocity w, angular acceleration e, and acceleration b of the origin, in the segment's axes."""
    here = np.cross(velocity[3:], at) + velocity[:3]
    origin = acceleration[:3] + np.cross(acceleration[3:], at) + np.cross(velocity[3:], here)
    for r in range(3):
        w[r], e[r], b[r] = 0.0, 0.0, 0.0
        for c in range(3):
            w[r] += rotation[c, r] * velocity[3 + c]
            e[r] += rotation[c, r] * acceleration[3 + c]
            b[r] += rotation[c, r] * origin[c]


@compiled
def _own_regressor(w: np.ndarray, e: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """out = (6, 10) in the segment's axes, about its origin."""
    out[:] = 0.0
    out[0, 0], out[1, 0], out[2, 0] = b[0], b[1], b[2]
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for r in range(3):
        for c in range(3):
            out[r, 1 + c] = w[r] * w[c]
        out[r, 1 + r] -= square
    out[0, 2] -= e[2]
    out[0, 3] += e[1]
    out[1, 1] += e[2]
    out[1, 3] -= e[0]
    out[2, 1] -= e[1]
    out[2, 2] += e[0]
    # columns of h x b
    out[3, 2], out[3, 3] = b[2], -b[1]
    out[4, 1], out[4, 3] = -b[2], b[0]
    out[5, 1], out[5, 2] = b[1], -b[0]
    # e and w x (I w) for xx, xy, yy, xz, yz, zz
    xx, yy, zz, xy, xz, yz = w[0] * w[0], w[1] * w[1], w[2] * w[2], w[0] * w[1], w[0] * w[2], w[1] * w[2]
    out[3, 4], out[3, 5], out[3, 6], out[3, 7], out[3, 8], out[3, 9] = e[0], e[1] - xz, -yz, e[2] + xy, yy - zz, yz
    out[4, 4], out[4, 5], out[4, 6], out[4, 7], out[4, 8], out[4, 9] = xz, e[0] + yz, e[1], zz - xx, e[2] - xy, -xz
    out[5, 4], out[5, 5], out[5, 6], out[5, 7], out[5, 8], out[5, 9] = -xy, xx - yy, xy, e[0] - yz, e[1] + xz, e[2]


@compiled
def _to_ground(rotation: np.ndarray, arm: np.ndarray, own: np.ndarray, out: np.ndarray) -> None:
    """out = (6, 10) the same in ground axes, about a point from which the segment's origin is at `arm`."""
    for c in range(10):
        for r in range(3):
            out[r, c] = rotation[r, 0] * own[0, c] + rotation[r, 1] * own[1, c] + rotation[r, 2] * own[2, c]
            out[3 + r, c] = rotation[r, 0] * own[3, c] + rotation[r, 1] * own[4, c] + rotation[r, 2] * own[5, c]
        out[3, c] += arm[1] * out[2, c] - arm[2] * out[1, c]
        out[4, c] += arm[2] * out[0, c] - arm[0] * out[2, c]
        out[5, c] += arm[0] * out[1, c] - arm[1] * out[0, c]
