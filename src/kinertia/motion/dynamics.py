"""Computes root equations of motion, their regressor and derivatives, and inverse dynamics of all joints.

The root is the pelvis: three translations, then three rotations (`coordinate_map.Root`), the free coordinates f;
all others, p, are prescribed. The root equations of motion, taken as force and moment about the pelvis origin in ground
axes, are

    (1)  P = M_f q_f'' + M_p q_p'' + V(q, q') + G(q) - F      F: the ground reactions
    (2)  q_f''* = M_f^-1 (F - M_p q_p'' - V - G)              the root acceleration that makes P zero

The residual is P: force (N) and moment (N m). The loads of the bodies come from `kinertia.motion.rigid_body`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.compiled import Float2, compiled, part
from kinertia.model.kinematic_tree import KinematicTree, place_segments
from kinertia.model.skeleton import Skeleton
from kinertia.motion.rigid_body import axis_force_derivatives, axis_forces, empty_frame, move
from kinertia.motion.workload import pieces


@dataclass(frozen=True)
class Motion:
    """Coordinates and their derivatives at n frames: `q`, `qd`, `qdd`, each (n, c), rad and m.

    Examples:
        >>> subject = kinertia.walking_subject()
        >>> trial = kinertia.walk(subject)
        >>> left = kinertia.residual(subject.skeleton, subject.bsp, trial.motion, trial.foot_loads.sum(axis=1))
        >>> bool(np.abs(left).max() < 1e-6)  # the motion is consistent with its ground reactions
        True
    """

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray

    def with_root(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> "Motion":
        """Return the motion with other root coordinates (each (n, 6))."""
        pairs = ((q, self.q), (qd, self.qd), (qdd, self.qdd))
        return Motion(*(np.hstack([root, every[:, 6:]]) for root, every in pairs))

    def cut(self, frames: slice | np.ndarray) -> "Motion":
        """Return the motion at these frames."""
        return Motion(self.q[frames], self.qd[frames], self.qdd[frames])


def joined(parts: Sequence[Motion]) -> Motion:
    """Concatenate parts of one motion."""
    return Motion(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "qd", "qdd")))


@dataclass(frozen=True)
class RootDerivatives:
    """Derivatives of the residual with respect to coordinates, velocities and accelerations.

    Each is (n, 6, c), with a column for each of the coordinates, or (n, 6, 6), for those of the root alone.
    """

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


def axis_motion(skeleton: Skeleton, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values, rates and accelerations of all axes, each (n, a), as compiled functions take them."""
    x, v, a = skeleton.map.motion(motion.q, motion.qd, motion.qdd)
    return np.ascontiguousarray(x), np.ascontiguousarray(v), np.ascontiguousarray(a)


def _state(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion
) -> tuple[KinematicTree, float, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what compiled functions take of a moving body, and the centre of its root's rotations."""
    about = np.ascontiguousarray(skeleton.root.centre(motion.q))
    return (skeleton.tree, skeleton.gravity_m_s2, skeleton.bodies(bsp), *axis_motion(skeleton, motion), about)


def residual(skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray) -> np.ndarray:
    """Compute the root residual P (n, 6), equation (1): inertial and gravity load minus the ground reactions.

    Args:
        skeleton, bsp: the model and its body segment parameters.
        motion: coordinates and derivatives.
        wrench: (n, 6) sum over both feet: force (N), moment about the ground origin (N m).
    """
    _, load, _ = axis_forces(*_state(skeleton, bsp, motion))
    return skeleton.root.about_centre(motion.q, load - wrench)


def residual_terms(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> tuple[np.ndarray, RootDerivatives]:
    """Compute P (n, 6) as in `residual`, and its derivatives by all coordinates; the centre moves with the root."""
    root, moving = skeleton.root, np.zeros(len(skeleton.tree.parent), dtype=bool)
    _, load, _, by_axes = axis_force_derivatives(*_state(skeleton, bsp, motion), moving)
    left = root.about_centre(motion.q, load - wrench)
    orders = by_axes[0], by_axes[1], by_axes[2]
    by = RootDerivatives(*skeleton.map.derivatives_to_coordinates(orders, motion.q, motion.qd, motion.qdd))
    by.q[:, 3:, :3] -= root.centre_moves(left)
    return left, by


def consistent_root_acceleration(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the root acceleration (n, 6) for which P is zero, equation (2), and its factor M_f (n, 6, 6)."""
    _, load, mass = axis_forces(*_state(skeleton, bsp, motion))
    left = skeleton.root.about_centre(motion.q, load - wrench)
    return motion.qdd[:, :6] - np.linalg.solve(mass, left[..., None])[..., 0], mass


def root_regressor(skeleton: Skeleton, segments: Sequence[str], motion: Motion) -> np.ndarray:
    """Compute Y (n, 6, 10 s) with P = Y phi - ground load, phi the dynamic parameters of `segments`.

    Parameters are in the segments' own frames.
    """
    about = skeleton.root.centre(motion.q)
    every = regressor(skeleton.tree, skeleton.gravity_m_s2, *axis_motion(skeleton, motion), about)
    rows = [skeleton.segments.index(segment) for segment in segments]
    chosen = every if rows == list(range(len(skeleton.segments))) else np.take(every, rows, axis=2)
    return chosen.reshape(len(chosen), 6, 10 * len(rows))


def segment_loads(skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion) -> np.ndarray:
    """Compute the load (s, n, 6) that each segment and what it carries require, N and N m about the root's centre."""
    parameters = np.zeros((len(skeleton.segments), 10))
    for bodies in (bsp, skeleton.carried):
        if bodies is not None:
            rows = [skeleton.segments.index(segment) for segment in bodies.segments]
            np.add.at(parameters, rows, bodies.dynamic_parameters().reshape(-1, 10))
    about = np.ascontiguousarray(skeleton.root.centre(motion.q))
    return required_loads(skeleton.tree, skeleton.gravity_m_s2, parameters, *axis_motion(skeleton, motion), about)


def root_derivatives(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> RootDerivatives:
    """Compute the derivatives of P with respect to the root coordinates, velocities and accelerations."""
    _, by = residual_terms(skeleton, bsp, motion, wrench)
    return RootDerivatives(by.q[:, :, :6], by.qd[:, :, :6], by.qdd[:, :, :6])


def inverse_dynamics(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    feet: Sequence[str] | None = None,
) -> np.ndarray:
    """Compute generalised forces (n, c) of all coordinates, N and N m, with the ground reactions acting on the feet.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, f, 6) per foot: force (N), moment about the ground origin (N m), ground axes.
        feet: the segments they act on; the skeleton's feet if None.
    """
    result = np.empty_like(motion.q)
    for some in pieces(len(result)):
        tau, _, _ = axis_forces(*_state(skeleton, bsp, motion.cut(some)))
        pose = skeleton.pose(motion.q[some])
        for i, foot in enumerate(skeleton.feet if feet is None else feet):
            moves = skeleton.support[skeleton.segments.index(foot)]
            tau[:, moves] -= (pose.axes[:, moves] @ foot_loads[some, i, :, None])[..., 0]
        result[some] = skeleton.map.to_coordinates(tau, pose.slopes)
    return result


@compiled
def regressor(tree: KinematicTree, gravity_m_s2: float, x: Float2, v: Float2, a: Float2, about: Float2) -> np.ndarray:
    """Compute the load (n, 6, s, 10) of every segment per unit of its ten parameters, in its own frame.

    Moments are about `about`; the other arguments are those of `axis_forces`. With w, e and b the angular velocity,
    angular acceleration and acceleration of the origin in the segment's axes, mass m, first moment h and inertia I
    require the force m b + e x h + w x (w x h) and, about the segment's origin, the moment h x b + I e + w x (I w).
    """
    n, count = x.shape
    segments = len(tree.last_axis)
    result = np.zeros((n, 6, segments, 10))
    frame = empty_frame(count, gravity_m_s2)
    rotation, translation = np.empty((segments, 3, 3)), np.empty((segments, 3))
    w, e, b, in_body = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10))
    for k in range(n):
        move(tree, x[k], v[k], a[k], frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        for s in range(segments):
            last_axis = tree.last_axis[s]
            if last_axis < 0:
                continue
            in_segment(frame.velocity[last_axis], frame.acceleration[last_axis], rotation[s], translation[s], w, e, b)
            own_regressor(w, e, b, in_body)
            to_ground(rotation[s], translation[s], about[k], in_body, result[k, :, s])
    return result


@compiled
def required_loads(
    tree: KinematicTree, gravity_m_s2: float, parameters: Float2, x: Float2, v: Float2, a: Float2, about: Float2
) -> np.ndarray:
    """Compute the loads (s, n, 6) of segments with parameters (s, 10): `regressor` times these, in less memory."""
    n, count = x.shape
    segments = len(tree.last_axis)
    result = np.zeros((segments, n, 6, 1))
    frame = empty_frame(count, gravity_m_s2)
    rotation, translation = np.empty((segments, 3, 3)), np.empty((segments, 3))
    w, e, b, in_body, load = np.empty(3), np.empty(3), np.empty(3), np.empty((6, 10)), np.empty((6, 1))
    for k in range(n):
        move(tree, x[k], v[k], a[k], frame)
        place_segments(tree, frame.rotation, frame.translation, rotation, translation)
        for s in range(segments):
            last_axis = tree.last_axis[s]
            if last_axis < 0:
                continue
            in_segment(frame.velocity[last_axis], frame.acceleration[last_axis], rotation[s], translation[s], w, e, b)
            own_regressor(w, e, b, in_body)
            for r in range(6):
                load[r, 0] = 0.0
                for c in range(10):
                    load[r, 0] += in_body[r, c] * parameters[s, c]
            to_ground(rotation[s], translation[s], about[k], load, result[s, k])
    return result[..., 0]


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
def to_ground(rotation: np.ndarray, at: np.ndarray, about: np.ndarray, in_body: np.ndarray, out: np.ndarray) -> None:
    """Write a regressor (6, 10) or load (6, 1) in ground axes, about another point, to `out`; the origin is at `at`."""
    x, y, z = at[0] - about[0], at[1] - about[1], at[2] - about[2]
    for c in range(in_body.shape[1]):
        for r in range(3):
            out[r, c] = rotation[r, 0] * in_body[0, c] + rotation[r, 1] * in_body[1, c] + rotation[r, 2] * in_body[2, c]
            out[3 + r, c] = (
                rotation[r, 0] * in_body[3, c] + rotation[r, 1] * in_body[4, c] + rotation[r, 2] * in_body[5, c]
            )
        out[3, c] += y * out[2, c] - z * out[1, c]
        out[4, c] += z * out[0, c] - x * out[2, c]
        out[5, c] += x * out[1, c] - y * out[0, c]
