"""Computes three-dimensional moments of hips, knees, ankles and lumbar joint in joint coordinate systems.

The axes are those of Grood and Suntay (1983, J Biomech Eng 105:136): flexion about the proximal segment's axis to the
right, rotation about the distal segment's long axis, adduction about the floating axis perpendicular to both. A foot's
long axis points forward: there inversion is about the long axis and rotation about the floating one. (The foot's axis
upward depends on how far the foot is rolled inward, which markers on heel and toes hardly show: 25 degrees of roll made
a rotation moment of 55 % of the plantarflexion moment.) The axes need not be perpendicular: each component is the whole
moment's projection on its axis, as the generalised force of a joint with these three rotations would be. Moments are
internal (of muscles, ligaments and contact, on the distal segment), about the joint's centre, and have equal signs on
both sides: positive towards flexion (ankle: dorsiflexion), adduction (ankle: inversion) and internal rotation; of the
lumbar joint towards flexion, bending to the right and turning to the left. External moments are the negative ones.
Reaction forces are those of the proximal on the distal segment, in the distal segment's axes forward, up and right.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.joint_wrench import BodyJoint, body_joints, joint_wrenches
from kinertia.motion.workload import pieces
from kinertia.trial.data import FEET

Frame = Literal["joint", "distal", "proximal"]
"""Axes of moments: the joint coordinate system (default), or the axes right, forward and up of either segment."""
_BENDS = {"Hip": 1.0, "Knee": -1.0, "Ankle": 1.0, "Lumbar": -1.0}
"""Sign of flexion (dorsiflexion) about the axis to the right."""
COMPONENTS, LUMBAR_COMPONENTS = ("flexion", "adduction", "rotation"), ("flexion", "bending", "rotation")
FORCES = ("forward", "up", "right")
_RIGHT_FORWARD_UP = (2, 0, 1)
_FREE = 0.5
"""A component is transmitted by constraint if the joint cannot turn within this (cosine) of its axis."""


@dataclass(frozen=True, eq=False)
class JointMoments:
    """Loads of j joints at n frames; NaN where they are not known.

    Attributes:
        joints: names: "hip_r", ..., "lumbar".
        moments: (n, j, 3) N m: flexion, adduction, rotation, as described in this module.
        forces: (n, j, 3) N: joint reaction force along the distal segment's axes forward, up, right.
        constraint: (j, 3) True for components that the model's joint does not move in: a hinge transmits them.
    """

    joints: tuple[str, ...]
    moments: np.ndarray
    forces: np.ndarray
    constraint: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Names (3 j) of the moments: "knee_r_flexion", "knee_r_adduction", "knee_r_rotation", ..."""
        return tuple(name for joint in self.joints for name in component_names(joint))

    @property
    def force_names(self) -> tuple[str, ...]:
        """Names (3 j) of the forces: "knee_r_force_forward", "knee_r_force_up", "knee_r_force_right", ..."""
        return tuple(f"{joint}_force_{axis}" for joint in self.joints for axis in FORCES)


def component_names(joint: str) -> tuple[str, str, str]:
    """Return the names of a joint's three moments.

    >>> component_names("knee_r"), component_names("lumbar")[1]
    (('knee_r_flexion', 'knee_r_adduction', 'knee_r_rotation'), 'lumbar_bending')
    """
    first, second, third = LUMBAR_COMPONENTS if joint == "lumbar" else COMPONENTS
    return f"{joint}_{first}", f"{joint}_{second}", f"{joint}_{third}"


def joint_and_side(name: str) -> tuple[str, str]:
    """Return a joint's name without its side, and the side.

    >>> joint_and_side("knee_r"), joint_and_side("lumbar")
    (('knee', 'r'), ('lumbar', ''))
    """
    base, _, side = name.rpartition("_")
    return (base, side) if side in FEET else (name, "")


def component_signs(joint: BodyJoint) -> np.ndarray:
    """Return the signs (3,) of rotations about axes right, forward and up: flexion, adduction, internal rotation."""
    mirrored = -1.0 if joint.side == "l" else 1.0
    return np.array([_BENDS[joint.name], mirrored, mirrored])


def joint_axes(parent: np.ndarray, child: np.ndarray, frame: Frame = "joint", long_axis: int = 1) -> np.ndarray:
    """Return unit axes (n, 3, 3) of flexion, adduction and rotation, in rows, in ground.

    Args:
        parent, child: (n, 3, 3) axes of the joint's segments in ground, in columns: forward, up, right.
        frame: of which axes.
        long_axis: of the child, `BodyJoint.long_axis`.
    """
    if frame != "joint":
        return (child if frame == "distal" else parent).swapaxes(1, 2)[:, list(_RIGHT_FORWARD_UP)]
    first, last = parent[:, :, 2], child[:, :, long_axis]
    floating = np.cross(last, first) if long_axis else np.cross(first, last)
    floating /= np.linalg.norm(floating, axis=1, keepdims=True)
    return np.stack([first, floating, last] if long_axis else [first, last, floating], axis=1)


def joint_moments(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    frame: Frame = "joint",
) -> JointMoments:
    """Compute the moments and reaction forces of `body_joints`.

    Args:
        skeleton, bsp, motion, foot_loads: as in `joint_wrenches`.
        frame: axes of the moments.
    """
    joints, n = body_joints(skeleton), len(motion.q)
    moments, forces = np.empty((n, len(joints), 3)), np.empty((n, len(joints), 3))
    for some in pieces(n):
        own = motion.cut(some)
        pose = skeleton.pose(own.q)
        wrenches = joint_wrenches(skeleton, bsp, own, foot_loads[some], joints)
        for k, joint in enumerate(joints):
            parent, child = (pose.rotation[:, skeleton.segments.index(one)] for one in (joint.parent, joint.child))
            axes, wrench = joint_axes(parent, child, frame, joint.long_axis), wrenches[joint]
            moments[some, k] = component_signs(joint) * np.einsum("nak,nk->na", axes, wrench[:, 3:])
            forces[some, k] = np.einsum("nka,nk->na", child, wrench[:, :3])
    return JointMoments(tuple(one.label for one in joints), moments, forces, constraints(skeleton, joints))


def constraints(skeleton: Skeleton, joints: Sequence[BodyJoint]) -> np.ndarray:
    """Return the mask (j, 3) of components that the joints transmit by constraint."""
    pose = skeleton.pose(np.zeros((1, len(skeleton.coordinates))))
    result = np.zeros((len(joints), 3), dtype=bool)
    for row, joint in enumerate(joints):
        parent, child = (skeleton.segments.index(one) for one in (joint.parent, joint.child))
        between = skeleton.support[child] & ~skeleton.support[parent]
        slopes = np.ones(len(between)) if pose.slopes is None else pose.slopes[0]
        turning = pose.axes[0, :, 3:] * (slopes * between)[:, None]
        turns = np.zeros((3, len(skeleton.coordinates)))
        np.add.at(turns.T, skeleton.map.owner, turning)
        axes = joint_axes(pose.rotation[:, parent], pose.rotation[:, child], long_axis=joint.long_axis)[0].T
        within = turns @ np.linalg.pinv(turns, rcond=1e-6) @ axes
        result[row] = np.linalg.norm(within, axis=0) < _FREE
    return result
