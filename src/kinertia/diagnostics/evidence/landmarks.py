"""Locates landmarks, the heading of feet and pelvis, and the body's centre from the markers alone."""

from collections.abc import Mapping

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import FEET, FloatArray, Markers

CLEAR = 0.5
"""Cosine beyond which a direction is clear: feet turn out and knees turn in by less than 60 degrees."""
_FLAT = 0.8
"""Cosine of 37 degrees."""
_GOES_M = 0.5
_AHEAD_OF_HEIGHT, _MEDIAL_OF_HEIGHT = 0.132, 0.035
"""Of stature, from the heel marker towards the second metatarsal head and across it. In six children of 1.23 to 1.74 m
the marker on the big toe is 0.126 to 0.139 ahead and 0.032 to 0.041 across."""
_AHEAD_OF_METATARSAL, _MEDIAL_OF_METATARSAL = 1.15, 0.3
"""Shares of the distance from heel to metatarsal head, used where stature is unknown."""
_SHARES = {"pelvis": 14.2, "torso": 40.0, "thigh": 12.3, "shank": 4.8, "foot": 1.2, "upper_arm": 2.4, "forearm": 2.3}
"""Per cent of the body's mass, head with torso, hand with forearm (Dumas 2007, men)."""
_SEEN = 0.8


def landmark_positions(markers: Markers, marker_set: MarkerSet) -> dict[str, FloatArray]:
    """Return the positions (n, 3) m of the landmarks whose labels are all present."""
    return {
        name: markers.select(labels).positions.mean(axis=1)
        for name, labels in marker_set.landmarks.items()
        if labels and set(labels) <= set(markers.labels)
    }


def feet_to_pelvis_m(places: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return the vector (3,) m from the feet to the pelvis, median over the frames; None where it is not visible."""
    feet = [place for name, place in places.items() if name.startswith(("heel", "ankle_lateral", "metatarsal"))]
    if not feet or not {"asis_r", "asis_l"} <= set(places):
        return None
    lines = (places["asis_r"] + places["asis_l"]) / 2 - np.mean(feet, axis=0)
    lines = lines[np.isfinite(lines).all(axis=1)]
    return np.asarray(np.median(lines, axis=0)) if len(lines) else None


def headings(places: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Compute unit headings (n, 3) of "foot_r", "foot_l" and "pelvis", each from its own back to its front, independent
    of side; NaN while a foot is steep: behind a runner it points down and backwards.
    """
    found = {}
    for side in "rl":
        toe = next((f"{name}_{side}" for name in ("metatarsal", "toe") if f"{name}_{side}" in places), "")
        if toe and f"heel_{side}" in places:
            along = places[toe] - places[f"heel_{side}"]
            flat = np.linalg.norm(horizontal(along), axis=1) > _FLAT * np.linalg.norm(along, axis=1)
            found[f"foot_{side}"] = np.where(flat[:, None], horizontal(along), np.nan)
    back = [places[name] for name in ("psis_r", "psis_l", "sacrum") if name in places]
    if back and {"asis_r", "asis_l"} <= set(places):
        found["pelvis"] = horizontal((places["asis_r"] + places["asis_l"]) / 2 - np.mean(back, axis=0))
    return {name: heading for name, heading in found.items() if np.isfinite(heading).all(axis=1).any()}


def most_forwards(markers: Markers, known: Mapping[str, FloatArray]) -> float:
    """Return the largest cosine of these headings to the travel of the markers' middle; 0 where either is unknown."""
    shown = np.asarray(np.isfinite(markers.positions).any(axis=(1, 2)))
    middle = np.nanmedian(markers.positions[shown], axis=1)
    if not known or len(middle) < 2 or np.linalg.norm(horizontal(middle[-1] - middle[0])) < _GOES_M:
        return 0.0
    way = np.broadcast_to(middle[-1] - middle[0], markers.positions[:, 0].shape)
    return max(cosine(direction, way) for direction in known.values())


def horizontal(vectors: FloatArray) -> FloatArray:
    """Return the horizontal part of the vectors."""
    result: FloatArray = vectors * np.array([1.0, 0.0, 1.0])
    return result


def unit(vectors: FloatArray) -> FloatArray:
    """Normalise vectors (..., 3); NaN where their length is zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        result: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


def cosine(vectors: FloatArray, others: FloatArray) -> float:
    """Return the median over frames of the cosine between the horizontal parts; 0 where nothing is visible."""
    with np.errstate(invalid="ignore"):
        cosines = (unit(horizontal(vectors)) * unit(horizontal(others))).sum(axis=-1)
    seen = cosines[np.isfinite(cosines)]
    return float(np.median(seen)) if seen.size else 0.0


def halluces(landmarks: Mapping[str, FloatArray], height_m: float | None) -> dict[str, FloatArray]:
    """Estimate the position (n, 3) m of each big toe ("r", "l"), as high as the metatarsal heads, for feet with a heel
    but no toe marker.

    Args:
        landmarks: (n, 3) m of every landmark.
        height_m: stature, where it is known.
    """
    found = {}
    for side in FEET:
        heel, front = landmarks.get(f"heel_{side}"), landmarks.get(f"metatarsal_{side}")
        if heel is None or front is None or f"toe_{side}" in landmarks:
            continue
        along = (front - heel) * [1.0, 0.0, 1.0]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / np.maximum(length, 1e-6)
        usual = float(np.nanmedian(length)) if np.isfinite(length).any() else np.nan
        ahead = _AHEAD_OF_METATARSAL * usual if height_m is None else _AHEAD_OF_HEIGHT * height_m
        across = _MEDIAL_OF_METATARSAL * usual if height_m is None else _MEDIAL_OF_HEIGHT * height_m
        to_left = np.cross([0.0, 1.0, 0.0], along)
        medial = to_left if side == "r" else -to_left
        found[side] = front + along * max(ahead - usual, 0.0) + medial * across
    return found


def owners_of(skeleton: Skeleton) -> dict[str, str]:
    """Return the segment of the anthropometric tables that each marker of a model is on; empty where unknown."""
    return {marker.label: segment_of(marker.segment) or "" for marker in skeleton.markers}


def body_centre(owners: Mapping[str, str], markers: Markers) -> FloatArray | None:
    """Compute the marker-based centre of mass (n, 3) m, each segment weighted by its share of body mass; None without a
    pelvis.

    Args:
        owners: the segment that each marker is on; markers on anything else (a backpack) do not count.
        markers: Y up.
    """
    seen = markers.seen
    places: dict[str, list[FloatArray]] = {}
    for column, label in enumerate(markers.labels):
        owner = owners.get(label, "")
        if _share(owner) and seen[:, column].mean() >= _SEEN:
            places.setdefault(owner, []).append(bridged_trajectory(markers.time, markers.positions[:, column]))
    if not places.keys() & {"pelvis", "torso"}:
        return None
    shares = {name: _share(name) for name in places}
    middles = (shares[name] * np.mean(landmarks, axis=0) for name, landmarks in places.items())
    total: FloatArray = sum(middles, np.zeros((len(seen), 3)))
    return total / sum(shares.values())


def _share(segment: str) -> float:
    return _SHARES.get(segment.removesuffix("_r").removesuffix("_l"), 0.0)


def bridged_trajectory(time: FloatArray, trajectory: FloatArray) -> FloatArray:
    """Return a trajectory (n, k) with unknown values bridged by straight lines."""
    known = np.isfinite(trajectory).all(axis=1)
    if known.all():
        return trajectory
    return np.stack([np.interp(time, time[known], along[known]) for along in trajectory.T], axis=1)
