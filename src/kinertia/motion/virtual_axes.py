"""Adds axes that never move to a skeleton, whose generalised forces are the whole load of a joint.

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

from kinertia.model.skeleton import Axis, Skeleton
from kinertia.motion.joint_wrench import BodyJoint

_KINDS: tuple[Literal["translation", "rotation"], ...] = ("translation", "rotation")


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
