"""Root equations of motion, their regressor and derivatives, and inverse dynamics of all joints (DESIGN section 5).

The root is the pelvis: three translations along the ground axes, then three rotations. "Residual" is the root load P of
equation (3): force (N) in ground axes, moment (N m) about the pelvis origin in ground axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kinertia.bsp import BodySegmentParameters
from kinertia.skeleton import Skeleton


@dataclass(frozen=True)
class Motion:
    """Coordinates and their derivatives at n frames: `q`, `qd`, `qdd`, each (n, c), rad and m."""

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


def root_axes(q: np.ndarray) -> np.ndarray:
    """(n, 3, 3): columns are the axes of tilt (z), list (x) and rotation (y) in ground; omega = A * angle rates."""
    tilt, lst = q[:, 3], q[:, 4]
    zero, one = np.zeros_like(tilt), np.ones_like(tilt)
    about_z = np.stack([zero, zero, one], axis=-1)
    about_x = np.stack([np.cos(tilt), np.sin(tilt), zero], axis=-1)
    about_y = np.stack([-np.sin(tilt) * np.cos(lst), np.cos(tilt) * np.cos(lst), np.sin(lst)], axis=-1)
    return np.stack([about_z, about_x, about_y], axis=-1)


def _generalised_to_load(q: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Root generalised forces (n, 6) or (n, 6, k) to force and moment about the pelvis origin, ground axes."""
    columns = tau if tau.ndim == 3 else tau[..., None]
    moment = np.linalg.solve(root_axes(q).transpose(0, 2, 1), columns[:, 3:])
    load = np.concatenate([columns[:, :3], moment], axis=1)
    return load if tau.ndim == 3 else load[..., 0]


def _load_to_generalised(q: np.ndarray, load: np.ndarray) -> np.ndarray:
    """The inverse of `_generalised_to_load`, (n, 6)."""
    turned = np.einsum("nij,ni->nj", root_axes(q), load[:, 3:])
    return np.concatenate([load[:, :3], turned], axis=1)


def _ground_load_at_pelvis(q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Sum of ground reactions (n, 6: force, moment about the ground origin) taken about the pelvis origin."""
    force, moment = wrench[:, :3], wrench[:, 3:]
    return np.concatenate([force, moment - np.cross(q[:, :3], force)], axis=1)


def ground_load_to_generalised(q: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Root generalised force (n, 6) of ground reactions (n, 6: force, moment about the ground origin)."""
    return _load_to_generalised(q, _ground_load_at_pelvis(q, wrench))


def residual(skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray) -> np.ndarray:
    """Root residual P (n, 6), equation (1): inertial and gravity load minus the ground reactions.

    Args:
        skeleton, bsp: the model and its body segment parameters.
        motion: coordinates and derivatives.
        wrench: (n, 6) sum over both feet: force (N), moment about the ground origin (N m).
    """
    model = skeleton.model_with(bsp)
    data = model.createData()
    rows = zip(motion.q, motion.qd, motion.qdd, strict=True)
    tau = np.array([pin.rnea(model, data, q, v, a)[:6] for q, v, a in rows])
    return _generalised_to_load(motion.q, tau) - _ground_load_at_pelvis(motion.q, wrench)


def consistent_root_acceleration(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Root acceleration (n, 6) that zeroes P at the given state, equation (2), and the mass matrices M_ff (n, 6, 6)."""
    model = skeleton.model_with(bsp)
    data = model.createData()
    mass = np.array([pin.crba(model, data, q)[:6, :6] for q in motion.q])
    mass = np.triu(mass) + np.triu(mass, 1).transpose(0, 2, 1)
    load = residual(skeleton, bsp, motion, wrench)
    generalised = _load_to_generalised(motion.q, load)
    return motion.qdd[:, :6] - np.linalg.solve(mass, generalised[..., None])[..., 0], mass


def root_regressor(skeleton: Skeleton, segments: Sequence[str], motion: Motion) -> np.ndarray:
    """Y (n, 6, 10 s) with P = Y phi - ground load, phi the dynamic parameters of `segments` in their own frames."""
    model, data = skeleton.model, skeleton.model.createData()
    joints, place = skeleton.placement_of_parameters(segments)
    columns = (10 * (joints - 1)[:, None] + np.arange(10)).ravel()
    rows = zip(motion.q, motion.qd, motion.qdd, strict=True)
    tau = np.array([pin.computeJointTorqueRegressor(model, data, q, v, a)[:6, columns] for q, v, a in rows])
    by_segment = tau.reshape(len(tau), 6, len(joints), 1, 10) @ place
    return _generalised_to_load(motion.q, by_segment.reshape(len(tau), 6, -1))


def root_derivatives(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, wrench: np.ndarray
) -> RootDerivatives:
    """Derivatives of P with respect to the root coordinates, velocities and accelerations."""
    model = skeleton.model_with(bsp)
    data = model.createData()
    n = len(motion.q)
    dq, dv, da = np.empty((n, 6, 6)), np.empty((n, 6, 6)), np.empty((n, 6, 6))
    tau = np.empty((n, 6))
    for k in range(n):
        pin.computeRNEADerivatives(model, data, motion.q[k], motion.qd[k], motion.qdd[k])
        tau[k] = data.tau[:6]
        dq[k], dv[k], da[k] = data.dtau_dq[:6, :6], data.dtau_dv[:6, :6], data.M[:6, :6]
    da = np.triu(da) + np.triu(da, 1).transpose(0, 2, 1)
    q = motion.q
    moment = _generalised_to_load(q, tau)[:, 3:]
    axes = root_axes(q)
    for later in range(3):
        for earlier in range(later):
            turned = np.cross(axes[:, :, earlier], axes[:, :, later])
            dq[:, 3 + later, 3 + earlier] -= np.einsum("ni,ni->n", turned, moment)
    dq = _generalised_to_load(q, dq)
    force = wrench[:, :3]
    for i, unit in enumerate(np.eye(3)):
        dq[:, 3:, i] += np.cross(unit, force)
    return RootDerivatives(dq, _generalised_to_load(q, dv), _generalised_to_load(q, da))


def inverse_dynamics(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    feet: Sequence[str] = ("foot_r", "foot_l"),
) -> np.ndarray:
    """Generalised forces (n, c) of all coordinates, N and N m, with the ground reactions acting on the feet.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, f, 6) per foot: force (N), moment about the ground origin (N m), ground axes.
        feet: the segments they act on.
    """
    model = skeleton.model_with(bsp)
    data = model.createData()
    rows = zip(motion.q, motion.qd, motion.qdd, strict=True)
    tau = np.array([pin.rnea(model, data, q, v, a) for q, v, a in rows])
    jacobian = skeleton.pose(motion.q).jacobian
    for i, foot in enumerate(feet):
        moves = skeleton.support[skeleton.segments.index(foot)]
        tau[:, moves] -= np.einsum("nic,ni->nc", jacobian[:, :, moves], foot_loads[:, i])
    return tau
