"""Computes the whole load of a leg joint; generalised forces contain only its parts along the joint's own axes."""

from dataclasses import dataclass

import numpy as np

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Joint, Pose, Skeleton
from kinertia.motion.dynamics import Motion, root_regressor
from kinertia.trial.data import FEET


@dataclass(frozen=True, eq=False)
class LegJoint:
    """Hip, knee or ankle of one leg.

    Attributes:
        name: "Hip", "Knee" or "Ankle".
        side: "r" or "l".
        parent, child: segments that it connects; for the ankle shank and foot, with any bodies between them.
        joints: its joints in the skeleton, in order: for the ankle talocrural and subtalar.
    """

    name: str
    side: str
    parent: str
    child: str
    joints: tuple[Joint, ...]

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


def leg_joints(skeleton: Skeleton) -> tuple[LegJoint, ...]:
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
            found.append(LegJoint(name, side, joints[0].parent, joints[-1].child, tuple(joints)))
    return tuple(found)


def joint_wrenches(
    skeleton: Skeleton, bsp: BodySegmentParameters, motion: Motion, foot_loads: np.ndarray
) -> dict[LegJoint, np.ndarray]:
    """Compute force (N) of the proximal on the distal segment and moment (N m) about joint centres (n, 6), ground axes.

    Args:
        skeleton, bsp, motion: as in `residual`.
        foot_loads: (n, 2, 6) on right and left foot: force (N), moment about the ground origin (N m).
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
    for joint in leg_joints(skeleton):
        load = needed[_beyond(skeleton, joint)].sum(axis=0) - ground[:, FEET.index(joint.side)]
        load[:, 3:] -= np.cross(joint.centre(skeleton, pose) - about, load[:, :3])
        result[joint] = load
    return result


def _beyond(skeleton: Skeleton, joint: LegJoint) -> list[int]:
    """Return the rows of the segments distal to a joint."""
    carried = {joint.joints[0].child}
    for each in skeleton.joints:  # parents before children
        if each.parent in carried:
            carried.add(each.child)
    return [row for row, name in enumerate(skeleton.segments) if name in carried]
