"""Computes the whole load of a joint, and moments of hips, knees, ankles and lumbar joint in three dimensions.

A hinge has one generalised force. What it transmits besides (the knee's adduction moment, or the force of the thigh on
the shank) are forces of constraint: the generalised forces of axes along which the joint could move but does not. With
three translations and three rotations at the centre of each joint, whose coordinates are always zero, inverse dynamics
and its derivatives give them, too, and nothing else changes.

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
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Axis, Joint, Pose, Skeleton
from kinertia.motion.dynamics import Motion, segment_loads
from kinertia.motion.workload import pieces
from kinertia.trial.data import FEET

_APART_DEG = 45.0
_KINDS: tuple[Literal["translation", "rotation"], ...] = ("translation", "rotation")
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
class BodyJoint:
    """Hip, knee or ankle of one leg, or the lumbar joint.

    Attributes:
        name: "Hip", "Knee", "Ankle" or "Lumbar".
        side: "r", "l", or "" for the lumbar joint.
        parent, child: segments that it connects; for the ankle shank and foot, with any bodies between them.
        joints: its joints in the skeleton, in order: for the ankle talocrural and subtalar.
    """

    name: str
    side: str
    parent: str
    child: str
    joints: tuple[Joint, ...]

    @property
    def label(self) -> str:
        """Name in tables: "knee_r", "lumbar"."""
        return f"{self.name.lower()}_{self.side}".rstrip("_")

    @property
    def long_axis(self) -> int:
        """Axis of the child along which it is longest: up (1), of feet forward (0)."""
        return 0 if self.name == "Ankle" else 1

    def columns(self, skeleton: Skeleton) -> list[int]:
        """Return the columns of its coordinates in q."""
        coordinates = {axis.coordinate for joint in self.joints for axis in joint.axes}
        return [k for k, name in enumerate(skeleton.coordinates) if name in coordinates]

    def centre(self, skeleton: Skeleton, pose: Pose) -> np.ndarray:
        """Return the joint centre (n, 3) m in ground; for the ankle that of the joint next to the shank."""
        first = self.joints[0]
        row = skeleton.segments.index(first.child)
        result: np.ndarray = pose.translation[:, row] + pose.rotation[:, row] @ first.child_translation
        return result


def leg_joints(skeleton: Skeleton) -> tuple[BodyJoint, ...]:
    """Return hip, knee and ankle of both legs, right first; empty if a leg lacks three joints in a row."""
    by_child = {joint.child: joint for joint in skeleton.joints}
    found = []
    for side, foot in zip(FEET, skeleton.feet, strict=True):
        path: list[Joint] = []
        segment = foot
        while segment in by_child and by_child[segment].parent != "ground":
            path.insert(0, by_child[segment])
            segment = by_child[segment].parent
        if len(path) < 3:
            return ()
        for name, joints in (("Hip", path[:1]), ("Knee", path[1:2]), ("Ankle", path[2:])):
            found.append(BodyJoint(name, side, joints[0].parent, joints[-1].child, tuple(joints)))
    return tuple(found)


def lumbar_joint(skeleton: Skeleton) -> BodyJoint | None:
    """Return the joint between pelvis and trunk: of those that carry no foot, the one with most beyond it."""
    pelvis, found = skeleton.segments[0], []
    for joint in skeleton.joints:
        candidate = BodyJoint("Lumbar", "", joint.parent, joint.child, (joint,))
        beyond = {skeleton.segments[row] for row in _beyond(skeleton, candidate)}
        if joint.parent == pelvis and not beyond & set(skeleton.feet):
            found.append((len(beyond), candidate))
    return max(found, key=lambda reach: reach[0])[1] if found else None


def body_joints(skeleton: Skeleton) -> tuple[BodyJoint, ...]:
    """Return `leg_joints` and the lumbar joint whose segments have axes forward, up and right (as ISB's) in neutral."""
    lumbar, legs = lumbar_joint(skeleton), leg_joints(skeleton)
    upright = legs if legs and axes_alike(skeleton, legs) else ()
    return upright + ((lumbar,) if lumbar is not None and axes_alike(skeleton, [lumbar]) else ())


def axes_alike(skeleton: Skeleton, joints: Sequence[BodyJoint]) -> bool:
    """Decide whether the joints' segments have axes forward, up and right where all coordinates are zero."""
    rotation = skeleton.neutral.rotation[0]
    rows = [[skeleton.segments.index(name) for name in (joint.parent, joint.child)] for joint in joints]
    turns = np.stack([rotation[parent].T @ rotation[child] for parent, child in rows])
    return bool(np.degrees(Rotation.from_matrix(turns).magnitude()).max() < _APART_DEG)


def joint_wrenches(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    joints: Sequence[BodyJoint] | None = None,
    pose: Pose | None = None,
) -> dict[BodyJoint, np.ndarray]:
    """Compute force (N) of the proximal on the distal segment and moment (N m) about joint centres (n, 6), ground axes.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, 2, 6) on right and left foot: force (N), moment about the ground origin (N m).
        joints: those to compute; `leg_joints` if None.
        pose: of this motion, where it is known already.
    """
    chosen = leg_joints(skeleton) if joints is None else joints
    if not chosen:
        return {}
    beyond, about = [_beyond(skeleton, joint) for joint in chosen], skeleton.root.centre(motion.q)
    pose = pose or skeleton.pose(motion.q)
    needed = segment_loads(skeleton, bsp, motion)
    ground = np.concatenate([foot_loads[..., :3], foot_loads[..., 3:]], axis=-1).copy()
    ground[..., 3:] -= np.cross(about[:, None], ground[..., :3])
    loads = np.stack([needed[rows].sum(axis=0) for rows in beyond])
    for load, joint in zip(loads, chosen, strict=True):
        load -= ground[:, FEET.index(joint.side)] if joint.side else 0.0
    arms = np.stack([joint.centre(skeleton, pose) for joint in chosen]) - about
    loads[..., 3:] -= np.cross(arms, loads[..., :3])
    return dict(zip(chosen, loads, strict=True))


def _beyond(skeleton: Skeleton, joint: BodyJoint) -> list[int]:
    """Return the rows of the segments distal to a joint."""
    carried = {joint.joints[0].child}
    for distal in skeleton.joints:  # parents before children
        if distal.parent in carried:
            carried.add(distal.child)
    return [row for row, name in enumerate(skeleton.segments) if name in carried]


@dataclass(frozen=True, eq=False)
class VirtualAxes:
    """A skeleton with six virtual axes for each of j joints.

    Attributes:
        skeleton: with the additional axes; its other coordinates are in their former order.
        joints: the joints.
        former: (c,) indices of the former coordinates among its own.
        added: (j, 6) indices of the additional ones: translations along x, y, z of the segment just beyond the joint's
            first axes, and rotations about them.
    """

    skeleton: Skeleton
    joints: tuple[BodyJoint, ...]
    former: np.ndarray
    added: np.ndarray

    @classmethod
    def of(cls, skeleton: Skeleton, joints: Sequence[BodyJoint]) -> Self:
        """Add the axes at the centres of these joints."""
        names = [[f"virtual {joint.label} {kind} {axis}" for kind in _KINDS for axis in "xyz"] for joint in joints]
        added = {joint.joints[0].child: axis_names for joint, axis_names in zip(joints, names, strict=True)}
        every = []
        for joint in skeleton.joints:
            directions = joint.child_rotation.T  # of the child's axes in the joint's far frame, in columns
            more = [
                Axis(name, _KINDS[k // 3], (float(x), float(y), float(z)))
                for k, name in enumerate(added.get(joint.child, []))
                for x, y, z in [directions[:, k % 3]]
            ]
            every.append(replace(joint, axes=(*joint.axes, *more)))
        larger = replace(skeleton, joints=tuple(every))
        index = {name: k for k, name in enumerate(larger.coordinates)}
        former = np.array([index[name] for name in skeleton.coordinates], dtype=int)
        return cls(
            larger,
            tuple(joints),
            former,
            np.array([[index[n] for n in axis_names] for axis_names in names], int).reshape(-1, 6),
        )

    def embedded(self, values: np.ndarray) -> np.ndarray:
        """Return (n, c) coordinates, or rates, of the former skeleton as those of this one; zero for virtual axes."""
        result = np.zeros((len(values), len(self.skeleton.coordinates)))
        result[:, self.former] = values
        return result

    @cached_property
    def bases(self) -> np.ndarray:
        """Indices (j,) of the segments in whose axes the virtual axes are."""
        return np.array([self.skeleton.segments.index(joint.joints[0].child) for joint in self.joints], dtype=int)

    @cached_property
    def parents(self) -> np.ndarray:
        """Indices (j,) of the joints' proximal segments."""
        return np.array([self.skeleton.segments.index(joint.parent) for joint in self.joints], dtype=int)

    @cached_property
    def children(self) -> np.ndarray:
        """Indices (j,) of the joints' distal segments."""
        return np.array([self.skeleton.segments.index(joint.child) for joint in self.joints], dtype=int)


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
    joints = body_joints(skeleton)
    loads = joint_loads(skeleton, bsp, motion, foot_loads, joints, frame)
    return JointMoments(tuple(joint.label for joint in joints), *loads, constraints(skeleton, joints))


def joint_loads(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    joints: Sequence[BodyJoint],
    frame: Frame = "joint",
) -> tuple[np.ndarray, np.ndarray]:
    """Compute moments and forces (n, j, 3) of some of `body_joints`, as in `JointMoments`."""
    n = len(motion.q)
    moments, forces = np.empty((n, len(joints), 3)), np.empty((n, len(joints), 3))
    for some in pieces(n):
        part = motion.cut(some)
        pose = skeleton.pose(part.q)
        wrenches = joint_wrenches(skeleton, bsp, part, foot_loads[some], joints, pose)
        for k, joint in enumerate(joints):
            parent, child = (
                pose.rotation[:, skeleton.segments.index(segment)] for segment in (joint.parent, joint.child)
            )
            axes, wrench = joint_axes(parent, child, frame, joint.long_axis), wrenches[joint]
            moments[some, k] = component_signs(joint) * np.einsum("nak,nk->na", axes, wrench[:, 3:])
            forces[some, k] = np.einsum("nka,nk->na", child, wrench[:, :3])
    return moments, forces


def constraints(skeleton: Skeleton, joints: Sequence[BodyJoint]) -> np.ndarray:
    """Return the mask (j, 3) of components that the joints transmit by constraint."""
    pose = skeleton.neutral
    result = np.zeros((len(joints), 3), dtype=bool)
    for row, joint in enumerate(joints):
        parent, child = (skeleton.segments.index(segment) for segment in (joint.parent, joint.child))
        between = skeleton.support[child] & ~skeleton.support[parent]
        slopes = np.ones(len(between)) if pose.slopes is None else pose.slopes[0]
        turning = pose.axes[0, :, 3:] * (slopes * between)[:, None]
        turns = np.zeros((3, len(skeleton.coordinates)))
        np.add.at(turns.T, skeleton.map.owner, turning)
        axes = joint_axes(pose.rotation[:, parent], pose.rotation[:, child], long_axis=joint.long_axis)[0].T
        within = turns @ np.linalg.pinv(turns, rcond=1e-6) @ axes
        result[row] = np.linalg.norm(within, axis=0) < _FREE
    return result
