"""Reads Theia's C3D files: poses of segments (group ROTATION), and virtual markers made of them.

Each segment has a frame at its proximal joint: x to the right, y forwards, z up along the segment; the position of the
next segment's frame in it is constant except for noise, and gives the joint centres. Every segment of the 27-DOF model
gets at least three virtual markers at the landmarks of the marker set "theia", so that the joint centres of the model
are Theia's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinertia.trial.data import FloatArray

POSE_SD_M = 0.01
"""SD of each coordinate of a virtual marker: poses of the legs repeat within a few mm and degrees from trial to
trial, and joint centres are 1 to 3 cm from those of markers (Kanko et al. 2021, J Biomech 127:110665)."""
_SUFFIX = "_4X4"
_BELL_HIP = (0.36, 0.19, 0.30)
"""Shares of the width between the ASIS by which the hip is to the side, behind and below (Bell et al. 1990)."""
_PELVIS_DEPTH = 0.65
_ACROMION_OF_WIDTH = 0.17
_HEEL_M = (0.0, -0.05, -0.05)
_SIDE_M = {"knee": 0.05, "ankle": 0.035, "elbow": 0.04, "foot": 0.04, "wrist": 0.01}
_STANDING_M = 1.0
"""Height of a standing person's pelvis: only differences matter."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of the segments of one trial, in the laboratory's axes.

    Attributes:
        rotation: segment -> (n, 3, 3); NaN where unknown.
        translation: segment -> (n, 3) in the file's unit.
        heels_m: side -> (3,) heel in the foot's frame, where the file states it.
    """

    rotation: Mapping[str, FloatArray]
    translation: Mapping[str, FloatArray]
    heels_m: Mapping[str, FloatArray]

    @classmethod
    def of(cls, labels: list[str], rotations: FloatArray, heels_m: Mapping[str, FloatArray]) -> Poses | None:
        """Build poses from ezc3d's (4, 4, k, n) of k labels; None without pelvis, thighs, shanks or feet."""
        frames = np.moveaxis(rotations, (2, 3), (0, 1))
        names = [label.strip().upper().removesuffix(_SUFFIX).lower() for label in labels]
        known = {name: frame for name, frame in zip(names, frames, strict=False) if np.isfinite(frame).any()}
        if not set(known) >= _LEGS:
            return None
        rotation = {name: np.asarray(frame[:, :3, :3], dtype=float) for name, frame in known.items()}
        translation = {name: np.asarray(frame[:, :3, 3], dtype=float) for name, frame in known.items()}
        return cls(rotation, translation, heels_m)

    def scaled(self, unit_m: float) -> Poses:
        """Return the poses with translations in metres."""
        return Poses(self.rotation, {name: unit_m * place for name, place in self.translation.items()}, self.heels_m)

    def inside(self, segment: str, child: str) -> FloatArray:
        """Return the position (3,) of the child's frame in that of the segment: median over the frames."""
        away = self.translation[child] - self.translation[segment]
        result: FloatArray = np.nanmedian(np.einsum("nji,nj->ni", self.rotation[segment], away), axis=0)
        return result

    def standing(self) -> Poses:
        """Return one frame of the same person standing upright, arms hanging, all segments' axes aligned."""
        at = {"pelvis": np.array([0.0, 0.0, _STANDING_M])}
        chains: list[tuple[str, ...]] = [("pelvis", f"{s}_thigh", f"{s}_shank", f"{s}_foot", f"{s}_toes") for s in "rl"]
        if "torso" in self.rotation:
            up = np.linalg.norm(self.translation["torso"] - self.translation["pelvis"], axis=1)
            at["torso"] = at["pelvis"] + [0.0, 0.0, float(np.nanmedian(up))]
            chains += [("torso", f"{s}_uarm", f"{s}_larm", f"{s}_hand") for s in "rl"]
        for chain in chains:
            for segment, child in pairwise(chain):
                if child in self.rotation and segment in at:
                    at[child] = at[segment] + self.inside(segment, child)
        upright = {name: np.eye(3)[None] for name in at}
        return Poses(upright, {name: place[None] for name, place in at.items()}, self.heels_m)


_LEGS = {"pelvis", *(f"{side}_{name}" for side in "rl" for name in ("thigh", "shank", "foot", "toes"))}


def virtual_places(poses: Poses) -> dict[str, tuple[str, FloatArray]]:
    """Return label -> segment and position (3,) m in its frame, for poses in metres."""
    places: dict[str, tuple[str, FloatArray]] = {}
    hips = {side: poses.inside("pelvis", f"{side}_thigh") for side in "rl"}
    aside, behind, below = _BELL_HIP
    width = float(np.linalg.norm(hips["r"] - hips["l"])) / (2 * aside)
    asis = (hips["r"] + hips["l"]) / 2 + width * np.array([0.0, behind, below])
    places["pose_sacrum"] = "pelvis", asis - np.array([0.0, _PELVIS_DEPTH * width, 0.0])
    for side, sign in (("r", 1.0), ("l", -1.0)):
        places[f"pose_asis_{side}"] = "pelvis", asis + np.array([sign * width / 2, 0.0, 0.0])
        thigh, shank, foot = (f"{side}_{name}" for name in ("thigh", "shank", "foot"))
        places[f"pose_hip_{side}"] = thigh, np.zeros(3)
        places |= _both_sides(thigh, poses.inside(thigh, shank), "knee", side, sign)
        places[f"pose_shank_{side}"] = shank, np.zeros(3)
        places |= _both_sides(shank, poses.inside(shank, foot), "ankle", side, sign)
        places[f"pose_heel_{side}"] = foot, np.asarray(poses.heels_m.get(side, np.array(_HEEL_M)))
        places[f"pose_metatarsal_{side}"] = foot, poses.inside(foot, f"{side}_toes")
        places[f"pose_foot_{side}"] = foot, np.array([sign * _SIDE_M["foot"], 0.0, 0.0])
    return places | _upper_places(poses)


def _upper_places(poses: Poses) -> dict[str, tuple[str, FloatArray]]:
    """Return the virtual markers of trunk and arms, if present."""
    places: dict[str, tuple[str, FloatArray]] = {}
    arms = {side: [f"{side}_{name}" for name in ("uarm", "larm", "hand")] for side in "rl"}
    if not {"torso", *(arm[0] for arm in arms.values())} <= set(poses.rotation):
        return places
    shoulders = {side: poses.inside("torso", arm[0]) for side, arm in arms.items()}
    rise = _ACROMION_OF_WIDTH * np.linalg.norm(shoulders["r"] - shoulders["l"])
    places["pose_back"] = "torso", np.array([0.0, 0.0, -0.35])
    for side, sign in (("r", 1.0), ("l", -1.0)):
        places[f"pose_acromion_{side}"] = "torso", shoulders[side] + [0.0, 0.0, rise]
        upper, lower, hand = arms[side]
        if {lower, hand} <= set(poses.rotation):
            places[f"pose_shoulder_{side}"] = upper, np.zeros(3)
            places |= _both_sides(upper, poses.inside(upper, lower), "elbow", side, sign)
            places[f"pose_forearm_{side}"] = lower, np.zeros(3)
            places |= _both_sides(lower, poses.inside(lower, hand), "wrist", side, sign)
    return places


def _both_sides(
    segment: str, joint: FloatArray, name: str, side: str, sign: float
) -> dict[str, tuple[str, FloatArray]]:
    across = np.array([sign * _SIDE_M[name], 0.0, 0.0])
    return {
        f"pose_{name}_lateral_{side}": (segment, joint + across),
        f"pose_{name}_medial_{side}": (segment, joint - across),
    }


def virtual_markers(poses: Poses, places: Mapping[str, tuple[str, FloatArray]]) -> FloatArray:
    """Return positions (n, m, 3) m, laboratory axes, of virtual markers at these places of poses in metres."""
    result = [
        poses.translation[segment] + poses.rotation[segment] @ place if segment in poses.rotation else None
        for segment, place in places.values()
    ]
    return np.stack([place for place in result if place is not None], axis=1)
