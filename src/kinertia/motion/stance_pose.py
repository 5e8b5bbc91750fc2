"""Extracts a standing pose from a walk, if there is no static trial.

No frame of a walk has both feet flat on the floor. But each foot is flat once in a stride, while the shank over it is
upright. These two frames, one of each leg, are put on one pelvis: rotated about the vertical and moved until the ASIS
coincide. Its knees are flexed by 10 to 20 degrees, which does not matter to a model built from segment frames.
"""

from collections.abc import Mapping

import numpy as np

from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

_FLAT_M = 0.02
"""Largest height of heel and forefoot together above their lowest."""
_LOWEST_PERCENT = 5
_NEAR_S = 0.1
"""A marker that is hidden in the frame is taken from one within this time."""


def stance_pose(markers: Markers, marker_set: MarkerSet) -> Markers | None:
    """Return one frame in which the person stands on both feet; None if no frame shows a pelvis over a flat foot.

    Args:
        markers: of a walk, in ground axes.
        marker_set: assignment of labels to landmarks.
    """
    place = {name: _landmark(markers, labels) for name, labels in marker_set.landmarks.items()}
    if not {"asis_r", "asis_l"} <= place.keys():
        return None
    across, middle = place["asis_r"] - place["asis_l"], (place["asis_r"] + place["asis_l"]) / 2
    pelvis = np.asarray(np.isfinite(across[:, 0]))
    frames = {side: _flat_frame(place, pelvis, side) for side in "rl"}
    base = frames["r"]
    if base is None or frames["l"] is None:
        return None
    left = {label for name, own in marker_set.segments.items() if name.startswith(_LEFT_LEG) for label in own}
    heading = np.arctan2(across[:, 0], across[:, 2])
    near = round(_NEAR_S * markers.rate_hz)
    pose = np.full((1, len(markers.labels), 3), np.nan)
    for k, label in enumerate(markers.labels):
        own = frames["l" if label in left else "r"]
        shown = np.flatnonzero(pelvis & np.isfinite(markers.positions[:, k, 0]))
        if own is None or not shown.size:
            continue
        frame = shown[np.argmin(np.abs(shown - own))]
        if abs(frame - own) <= near:
            turn = heading[base] - heading[frame]
            pose[0, k] = middle[base] + _turned(markers.positions[frame, k] - middle[frame], turn)
    return Markers(markers.time[[base]], markers.labels, pose)


_OF_FOOT = ("heel", "metatarsal", "ankle_lateral", "knee_lateral")
_LEFT_LEG = ("thigh_l", "shank_l", "foot_l")


def _landmark(markers: Markers, labels: tuple[str, ...]) -> FloatArray:
    """Return the mean position (n, 3) m of those labels that the trial has; NaN without any."""
    own = [label for label in labels if label in markers.labels]
    if not own:
        return np.full((len(markers.time), 3), np.nan)
    middle: FloatArray = markers.select(own).positions.mean(axis=1)
    return middle


def hidden_landmarks(markers: Markers, marker_set: MarkerSet) -> list[str]:
    """List the landmarks that a `stance_pose` needs and no frame shows."""
    names = ["asis_r", "asis_l", *(f"{name}_{side}" for side in "rl" for name in _OF_FOOT)]
    every = {name: _landmark(markers, marker_set.landmarks.get(name, ())) for name in names}
    return [name for name, place in every.items() if not np.isfinite(place[:, 0]).any()]


def _flat_frame(place: Mapping[str, FloatArray], pelvis: np.ndarray, side: str) -> int | None:
    """Return the frame in which this foot is flat and the shank over it most upright."""
    names = [f"{name}_{side}" for name in _OF_FOOT]
    if not set(names) <= place.keys():
        return None
    heel, forefoot, ankle, knee = (place[name] for name in names)
    shown = np.flatnonzero(pelvis & np.isfinite(heel + forefoot + ankle + knee).all(axis=1))
    if not shown.size:
        return None
    lowest = [float(np.percentile(each[shown, 1], _LOWEST_PERCENT)) for each in (heel, forefoot)]
    height = heel[shown, 1] + forefoot[shown, 1] - sum(lowest)
    shank = (knee - ankle)[shown]
    lean = np.linalg.norm(shank[:, [0, 2]], axis=1) / np.linalg.norm(shank, axis=1)
    flat = height <= max(_FLAT_M, float(height.min()))
    return int(shown[np.argmin(np.where(flat, lean, np.inf))])


def _turned(vector: FloatArray, angle_rad: float) -> FloatArray:
    """Rotate a vector (3,) about the vertical."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = vector
    return np.array([cosine * x + sine * z, y, cosine * z - sine * x])
