"""Estimates the position of a big toe without a marker, as the last point of push-off."""

from collections.abc import Mapping

import numpy as np

from kinertia.trial.data import FEET, FloatArray

_AHEAD_OF_HEIGHT, _MEDIAL_OF_HEIGHT = 0.132, 0.035
"""Of stature, from the heel marker towards the second metatarsal head and across it. In six children of 1.23 to 1.74 m
the marker on the big toe is 0.126 to 0.139 ahead and 0.032 to 0.041 across."""
_AHEAD_OF_METATARSAL, _MEDIAL_OF_METATARSAL = 1.15, 0.3
"""Shares of the distance from heel to metatarsal head, used where stature is unknown."""


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
