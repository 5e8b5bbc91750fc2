"""Joint centres and segment axes of Vicon's Plug-in Gait, which its C3D files hold as points.

Each segment has four: its origin ("LFEO"), and one on each of its axes: anterior ("LFEA"), lateral ("LFEL") and
proximal ("LFEP").
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.motion.joint_moments import BodyJoint
from kinertia.trial.file_contents import FileOutputs
from kinertia.trial.sampled_data import nearest_samples

_SEGMENTS = {"Hip": "FE", "Knee": "TI", "Ankle": "FO"}
"""Vicon's name of the segment below each joint, in whose axes it gives the moment."""
_CENTRES = {"Hip": "FEP", "Knee": "FEO", "Ankle": "TIO"}
"""The point that is the joint's centre."""
_DIRECTIONS = "ALP"


@dataclass(frozen=True, eq=False)
class ViconPoints:
    """Points of a file at f frames, in ground axes, m; NaN where missing."""

    points: Mapping[str, np.ndarray]

    @classmethod
    def at(cls, outputs: FileOutputs, time: np.ndarray) -> Self:
        """Take the points at the frames nearest to these times (f,)."""
        rows = nearest_samples(outputs.time, time)
        return cls({name: each[rows] for name, each in outputs.points.items()})

    def centre(self, joint: BodyJoint) -> np.ndarray | None:
        """Return a joint's centre (f, 3); None if the file lacks it."""
        return self.points.get(joint.side.upper() + _CENTRES[joint.name])

    def axes(self, joint: BodyJoint, ours: np.ndarray) -> np.ndarray | None:
        """Return the axes (f, 3, 3) of the segment below a joint in columns, each nearest to ours; None if lacking.

        Args:
            joint: the joint.
            ours: (f, 3, 3) Kinertia's axes of the segment in columns.
        """
        segment = joint.side.upper() + _SEGMENTS[joint.name]
        own = [self.points.get(segment + letter) for letter in "O" + _DIRECTIONS]
        if any(point is None for point in own):
            return None
        origin, *ends = (np.asarray(point) for point in own)
        found = np.stack([end - origin for end in ends], axis=2)
        found = found / np.linalg.norm(found, axis=1, keepdims=True)
        alike = np.nanmean(np.einsum("fki,fkj->fij", ours, found), axis=0)
        nearest = np.abs(alike).argmax(axis=1)
        if len(set(nearest)) < len(nearest):
            return None
        result: np.ndarray = found[:, :, nearest] * np.sign(alike[range(3), nearest])
        return result
