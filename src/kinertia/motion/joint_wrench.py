"""Computes the whole load of a joint; generalised forces contain only its parts along the joint's own axes.

A hinge has one generalised force. What it transmits besides (the knee's adduction moment, or the force of the thigh on
the shank) are forces of constraint: the generalised forces of axes along which the joint could move but does not. With
three translations and three rotations at the centre of each joint, whose coordinates are always zero, inverse dynamics
and its derivatives give them, too, and nothing else changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Axis, Joint, Pose, Skeleton
from kinertia.motion.dynamics import Motion, root_regressor
from kinertia.trial.data import FEET

_APART_DEG = 45.0
_KINDS: tuple[Literal["translation", "rotation"], ...] = ("translation", "rotation")


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
        own = {axis.coordinate for joint in self.joints for axis in joint.axes}
        return [k for k, name in enumerate(skeleton.coordinates) if name in own]

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
        own = BodyJoint("Lumbar", "", joint.parent, joint.child, (joint,))
        beyond = {skeleton.segments[row] for row in _beyond(skeleton, own)}
        if joint.parent == pelvis and not beyond & set(skeleton.feet):
            found.append((len(beyond), own))
    return max(found, key=lambda each: each[0])[1] if found else None


def body_joints(skeleton: Skeleton) -> tuple[BodyJoint, ...]:
    """Return `leg_joints` and the lumbar joint whose segments have axes forward, up and right (as ISB's) in neutral."""
    lumbar, legs = lumbar_joint(skeleton), leg_joints(skeleton)
    upright = legs if legs and axes_alike(skeleton, legs) else ()
    return upright + ((lumbar,) if lumbar is not None and axes_alike(skeleton, [lumbar]) else ())


def axes_alike(skeleton: Skeleton, joints: Sequence[BodyJoint]) -> bool:
    """Decide whether the joints' segments have axes forward, up and right where all coordinates are zero."""
    rotation = skeleton.pose(np.zeros((1, len(skeleton.coordinates)))).rotation[0]
    rows = [[skeleton.segments.index(name) for name in (joint.parent, joint.child)] for joint in joints]
    turns = np.stack([rotation[parent].T @ rotation[child] for parent, child in rows])
    return bool(np.degrees(Rotation.from_matrix(turns).magnitude()).max() < _APART_DEG)


def joint_wrenches(
    skeleton: Skeleton,
    bsp: BodySegmentParameters,
    motion: Motion,
    foot_loads: np.ndarray,
    joints: Sequence[BodyJoint] | None = None,
) -> dict[BodyJoint, np.ndarray]:
    """Compute force (N) of the proximal on the distal segment and moment (N m) about joint centres (n, 6), ground axes.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, 2, 6) on right and left foot: force (N), moment about the ground origin (N m).
        joints: those to compute; `leg_joints` if None.
    """
    pose, about = skeleton.pose(motion.q), skeleton.root.centre(motion.q)
    needed = np.zeros((len(skeleton.segments), len(motion.q), 6))
    for part in (bsp, skeleton.carried):
        if part is not None:
            loads = root_regressor(skeleton, part.segments, motion).reshape(len(motion.q), 6, -1, 10)
            own = np.einsum("nisk,sk->sni", loads, part.dynamic_parameters().reshape(-1, 10))
            np.add.at(needed, [skeleton.segments.index(name) for name in part.segments], own)
    ground = np.concatenate([foot_loads[..., :3], foot_loads[..., 3:]], axis=-1).copy()
    ground[..., 3:] -= np.cross(about[:, None], ground[..., :3])
    result = {}
    for joint in leg_joints(skeleton) if joints is None else joints:
        load = needed[_beyond(skeleton, joint)].sum(axis=0)
        load -= ground[:, FEET.index(joint.side)] if joint.side else 0.0
        load[:, 3:] -= np.cross(joint.centre(skeleton, pose) - about, load[:, :3])
        result[joint] = load
    return result


def _beyond(skeleton: Skeleton, joint: BodyJoint) -> list[int]:
    """Return the rows of the segments distal to a joint."""
    carried = {joint.joints[0].child}
    for each in skeleton.joints:  # parents before children
        if each.parent in carried:
            carried.add(each.child)
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
        added = {joint.joints[0].child: own for joint, own in zip(joints, names, strict=True)}
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
            larger, tuple(joints), former, np.array([[index[n] for n in own] for own in names], int).reshape(-1, 6)
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
