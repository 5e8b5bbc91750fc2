"""Root equations of motion, their regressor and derivatives, and inverse dynamics of all joints.

The root is the pelvis: three translations, then three rotations (`kinertia.model.root_joint`), the free coordinates f;
all others, p, are prescribed. Of the equations of motion the root rows are

    (1)  P = M_f q_f'' + M_p q_p'' + V(q, q') + G(q) - F      F: generalised force of the ground reactions
    (2)  q_f''* = M_f^-1 (F - M_p q_p'' - V - G)              the root acceleration that makes P zero

The residual is P: force (N) in ground axes, moment (N m) about the pelvis origin in ground axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton


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

    def with_root(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> Motion:
        """The same motion with other root coordinates (each (n, 6))."""
        pairs = ((q, self.q), (qd, self.qd), (qdd, self.qdd))
        return Motion(*(np.hstack([root, every[:, 6:]]) for root, every in pairs))

    def cut(self, frames: slice | np.ndarray) -> Motion:
        """The motion at these frames."""
        return Motion(self.q[frames], self.qd[frames], self.qdd[frames])


def joined(parts: Sequence[Motion]) -> Motion:
    """Stretches of one motion, one after the other."""
    return Motion(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "qd", "qdd")))


@dataclass(frozen=True)
class RootDerivatives:
    """Derivatives of the residual with respect to root position, velocity and acceleration, each (n, 6, 6)."""

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


def _axes(skeleton: Skeleton, motion: Motion) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Place, rate and acceleration of all axes, frame by frame."""
    return zip(*skeleton.map.motion(motion.q, motion.qd, motion.qdd), strict=True)


def residual(skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray) -> np.ndarray:
    """Root residual P (n, 6), equation (1): inertial and gravity load minus the ground reactions.

    Args:
        skeleton, bsp: the model and its body segment parameters.
        motion: coordinates and derivatives.
        wrench: (n, 6) sum over both feet: force (N), moment about the ground origin (N m).
    """
    model = skeleton.model_with(bsp)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, x, v, a)[:6] for x, v, a in _axes(skeleton, motion)])
    result: np.ndarray = skeleton.root.load(motion.q, tau) - skeleton.root.ground_load(motion.q, wrench)
    return result


def consistent_root_acceleration(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Root acceleration (n, 6) that zeroes P at the given state, equation (2), and the mass matrices M_ff (n, 6, 6)."""
    model = skeleton.model_with(bsp)
    data = model.createData()
    mass = np.array([pin.crba(model, data, x)[:6, :6] for x in skeleton.map.axes(motion.q)])
    mass = np.triu(mass) + np.triu(mass, 1).transpose(0, 2, 1)
    load = residual(skeleton, bsp, motion, wrench)
    generalised = skeleton.root.generalised(motion.q, load)
    return motion.qdd[:, :6] - np.linalg.solve(mass, generalised[..., None])[..., 0], mass


def root_regressor(skeleton: Skeleton, segments: Sequence[str], motion: Motion) -> np.ndarray:
    """Y (n, 6, 10 s) with P = Y phi - ground load, phi the dynamic parameters of `segments` in their own frames."""
    model, data = skeleton.model, skeleton.model.createData()
    joints, place = skeleton.placement_of_parameters(segments)
    columns = (10 * (joints - 1)[:, None] + np.arange(10)).ravel()
    rows = _axes(skeleton, motion)
    tau = np.array([pin.computeJointTorqueRegressor(model, data, x, v, a)[:6, columns] for x, v, a in rows])
    by_segment = tau.reshape(len(tau), 6, len(joints), 1, 10) @ place
    return skeleton.root.load(motion.q, by_segment.reshape(len(tau), 6, -1))


def root_derivatives(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> RootDerivatives:
    """Derivatives of P with respect to the root coordinates, velocities and accelerations."""
    model = skeleton.model_with(bsp)
    data = model.createData()
    n = len(motion.q)
    dq, dv, da = np.empty((n, 6, 6)), np.empty((n, 6, 6)), np.empty((n, 6, 6))
    tau = np.empty((n, 6))
    for k, (x, v, a) in enumerate(_axes(skeleton, motion)):
        pin.computeRNEADerivatives(model, data, x, v, a)
        tau[k] = data.tau[:6]
        dq[k], dv[k], da[k] = data.dtau_dq[:6, :6], data.dtau_dv[:6, :6], data.M[:6, :6]
    da = np.triu(da) + np.triu(da, 1).transpose(0, 2, 1)
    q, root = motion.q, skeleton.root
    dq[:, 3:, 3:] -= root.turning(root.axes(q), root.load(q, tau)[:, 3:])
    dq = root.load(q, dq)
    for i, direction in enumerate((root.rotation @ root.slides).T):
        dq[:, 3:, i] += np.cross(direction, wrench[:, :3])
    return RootDerivatives(dq, root.load(q, dv), root.load(q, da))


def inverse_dynamics(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    feet: Sequence[str] | None = None,
) -> np.ndarray:
    """Generalised forces (n, c) of all coordinates, N and N m, with the ground reactions acting on the feet.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, f, 6) per foot: force (N), moment about the ground origin (N m), ground axes.
        feet: the segments they act on; the skeleton's feet if None.
    """
    model = skeleton.model_with(bsp)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, x, v, a) for x, v, a in _axes(skeleton, motion)])
    pose = skeleton.pose(motion.q)
    for i, foot in enumerate(skeleton.feet if feet is None else feet):
        moves = skeleton.support[skeleton.segments.index(foot)]
        tau[:, moves] -= np.einsum("nic,ni->nc", pose.jacobian[:, :, moves], foot_loads[:, i])
    return skeleton.map.to_coordinates(tau, pose.slopes)
