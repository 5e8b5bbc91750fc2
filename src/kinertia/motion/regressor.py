"""Computes each segment's load per unit of its ten dynamic parameters, in compiled code."""

import numpy as np

from kinertia.model.compiled import Float2, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, place_segments
from kinertia.motion.rigid_body import empty_frame, move


@compiled
def regressor(tree: KinematicTree, gravity_m_s2: float, x: Float2, v: Float2, a: Float2, about: Float2) -> np.ndarray:
    """Compute the load (n, 6, s, 10) of every segment per unit of its ten parameters, in its own frame.

    Moments are about `about`; the other arguments are those of `axis_forces`. With w, e and b the angular velocity,
    angular acceleration and acceleration of the origin in the segment's axes, mass m, first moment h and inertia I
    require the force m b + e x h + w x (w x h) and, about the segment's origin, the moment h x b + I e + w x (I w).
    """
    n, count = x.shape
    segments = len(tree.carrier)
    result = np.zeros((n, 6, segments, 10))
    frame = empty_frame(count, gravity_m_s2)
    rotation, translation = np.empty((segments, 3, 3)), np.empty((segments, 3))
    w, e, b, own = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10))
    for k in range(n):
        move(tree, x[k], v[k], a[k], frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        for s in range(segments):
            carrier = tree.carrier[s]
            if carrier < 0:
                continue
            in_segment(frame.velocity[carrier], frame.acceleration[carrier], rotation[s], translation[s], w, e, b)
            own_regressor(w, e, b, own)
            to_ground(rotation[s], translation[s], about[k], own, result[k, :, s])
    return result


@part
def in_segment(
    velocity: np.ndarray,
    acceleration: np.ndarray,
    rotation: np.ndarray,
    at: np.ndarray,
    w: np.ndarray,
    e: np.ndarray,
    b: np.ndarray,
) -> None:
    """Write angular velocity w, angular acceleration e and acceleration b of the origin, in the segment's axes."""
    vx, vy, vz, wx, wy, wz = velocity[0], velocity[1], velocity[2], velocity[3], velocity[4], velocity[5]
    ax, ay, az = acceleration[0], acceleration[1], acceleration[2]
    ex, ey, ez = acceleration[3], acceleration[4], acceleration[5]
    x, y, z = at[0], at[1], at[2]
    hx, hy, hz = vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
    origin = (
        ax + ey * z - ez * y + wy * hz - wz * hy,
        ay + ez * x - ex * z + wz * hx - wx * hz,
        az + ex * y - ey * x + wx * hy - wy * hx,
    )
    for r in range(3):
        w[r], e[r], b[r] = 0.0, 0.0, 0.0
        for c in range(3):
            w[r] += rotation[c, r] * velocity[3 + c]
            e[r] += rotation[c, r] * acceleration[3 + c]
            b[r] += rotation[c, r] * origin[c]


@part
def own_regressor(w: np.ndarray, e: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """Write the regressor (6, 10) in the segment's axes, about its origin, to `out`."""
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


@part
def to_ground(rotation: np.ndarray, at: np.ndarray, about: np.ndarray, own: np.ndarray, out: np.ndarray) -> None:
    """Write the regressor (6, 10) in ground axes and about another point to `out`; the segment's origin is at `at`."""
    x, y, z = at[0] - about[0], at[1] - about[1], at[2] - about[2]
    for c in range(10):
        for r in range(3):
            out[r, c] = rotation[r, 0] * own[0, c] + rotation[r, 1] * own[1, c] + rotation[r, 2] * own[2, c]
            out[3 + r, c] = rotation[r, 0] * own[3, c] + rotation[r, 1] * own[4, c] + rotation[r, 2] * own[5, c]
        out[3, c] += y * out[2, c] - z * out[1, c]
        out[4, c] += z * out[0, c] - x * out[2, c]
        out[5, c] += x * out[1, c] - y * out[0, c]
