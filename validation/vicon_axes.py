"""Joint centres and segment axes of Vicon's Plug-in Gait, which its C3D files hold as points, in a trial's ground.

Each segment has four: its origin (`LFEO`), and one on each of its axes: anterior (`LFEA`), lateral (`LFEL`) and
proximal (`LFEP`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.io.c3d.outputs import frames_of
from kinertia.motion.joint_wrench import BodyJoint
from kinertia.trial.data import Trial

_SEGMENTS = {"Hip": "FE", "Knee": "TI", "Ankle": "FO"}
"""Vicon's name of the segment beyond each joint, in whose axes it gives the moment."""
_CENTRES = {"Hip": "FEP", "Knee": "FEO", "Ankle": "TIO"}
"""The point that is the joint's centre."""
_ALIGNED_M = 0.002
_DIRECTIONS = "ALP"


@dataclass(frozen=True, eq=False)
class ViconPoints:
    """Points of a file at the f frames of a trial, in its ground, m; NaN where missing."""

    points: Mapping[str, np.ndarray]

    @classmethod
    def read(cls, path: Path, trial: Trial) -> "ViconPoints":
        """Read the points of a trial's file.

        Raises:
            ValueError: the markers of the file are not those of the trial.
        """
        frames = frames_of(path)
        at = np.round(trial.markers.time * frames.rate_hz - (frames.first - 1)).astype(int)
        columns = {label.rpartition(":")[2]: k for k, label in enumerate(frames.labels)}
        shared = [label for label in trial.markers.labels if label in columns]
        raw = np.where((frames.points == 0.0).all(axis=2)[..., None], np.nan, frames.points)[at]
        there = trial.markers.positions[:, [trial.markers.labels.index(label) for label in shared]].reshape(-1, 3)
        here = raw[:, [columns[label] for label in shared]].reshape(-1, 3) * 1e-3
        both = np.isfinite(there).all(axis=1) & np.isfinite(here).all(axis=1)
        middle, place = here[both].mean(axis=0), there[both].mean(axis=0)
        turn = Rotation.align_vectors(there[both] - place, here[both] - middle)[0]
        apart = np.linalg.norm(turn.apply(here[both] - middle) + place - there[both], axis=1)
        if np.median(apart) > _ALIGNED_M:
            raise ValueError(f"{path}: markers are not those of trial {trial.name}")
        names = [name for name in columns if len(name) == 4 and name[0] in "LR"]
        return cls({name: _turned(turn, raw[:, columns[name]] * 1e-3 - middle) + place for name in names})

    def at(self, frames: slice) -> "ViconPoints":
        """Return the points at these frames."""
        return ViconPoints({name: each[frames] for name, each in self.points.items()})

    def centre(self, joint: BodyJoint) -> np.ndarray | None:
        """Return a joint's centre (f, 3); None if the file lacks it."""
        return self.points.get(joint.side.upper() + _CENTRES[joint.name])

    def axes(self, joint: BodyJoint, ours: np.ndarray) -> np.ndarray | None:
        """Return the axes (f, 3, 3) of the segment beyond a joint in columns, each nearest to ours; None if lacking.

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


def _turned(turn: Rotation, places: np.ndarray) -> np.ndarray:
    result: np.ndarray = places @ turn.as_matrix().T
    return result
