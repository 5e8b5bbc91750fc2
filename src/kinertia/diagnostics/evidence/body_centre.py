"""Approximates the body's centre by its markers alone, without a model."""

from collections.abc import Mapping

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import FloatArray, Markers

_SHARES = {"pelvis": 14.2, "torso": 40.0, "thigh": 12.3, "shank": 4.8, "foot": 1.2, "upper_arm": 2.4, "forearm": 2.3}
"""Per cent of the body's mass, head with torso, hand with forearm (Dumas 2007, men)."""
_SEEN = 0.8


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
    middles = (shares[name] * np.mean(own, axis=0) for name, own in places.items())
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
