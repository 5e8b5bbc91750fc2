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
from kinertia.model.kinematic_tree import KinematicTree
from kinertia.model.skeleton import Skeleton
from kinertia.motion.regressor import regressor
from kinertia.motion.rigid_body import axis_force_derivatives, axis_forces
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
