"""Is the floor level by the feet that stand on it? What a tilted axis of the cameras does first.

On six sound walks over 1.5 to 4.3 m the places where feet stand rise by up to 0.07 degrees along the walkway, and lie
on a line within 2 mm; cameras that are tilted by 3 degrees show 2.9 to 3.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinertia.trial.data import FloatArray, Markers
from kinertia.trial.sampled_time import runs, span_s

_STILL_M_S, _SHORTEST_S = 0.15, 0.08
_LONGEST_M, _FEWEST_PLACES = 1.0, 3
_TILTED_DEG, _STEEP_DEG, _OFF_LINE_M = 0.8, 10.0, 0.006
"""Steeper are stairs, and jumps from a box."""


def walkway_slope_doubts(markers: Markers, feet: Mapping[str, Sequence[str]]) -> list[str]:
    """A floor that rises or falls along the way.

    Args:
        markers: of a motion over ground.
        feet: labels of the markers on each foot.
    """
    labels = [label for own in feet.values() for label in own if label in markers.labels]
    stands = [_stands(markers.time, markers.positions[:, markers.labels.index(label)]) for label in labels]
    of_marker = np.repeat(np.arange(len(labels)), [len(one) for one in stands])
    if len(of_marker) < _FEWEST_PLACES + len(labels):
        return []
    place = np.concatenate(stands)
    level = place[:, [0, 2]] - place[:, [0, 2]].mean(axis=0)
    way = np.linalg.svd(level, full_matrices=False)[2][0]
    along = level @ way
    if np.ptp(along) < _LONGEST_M:
        return []
    # every marker is as high above the floor as it is
    terms = np.column_stack([along, *(of_marker == k for k in range(len(labels)) if (of_marker == k).any())])
    fitted, *_ = np.linalg.lstsq(terms, place[:, 1], rcond=None)
    off = float(np.sqrt(np.square(place[:, 1] - terms @ fitted).mean()))
    degrees = float(np.degrees(np.arctan(fitted[0])))
    if not _TILTED_DEG < abs(degrees) < _STEEP_DEG or off > _OFF_LINE_M:
        return []
    return [
        f"the floor under the feet rises by {abs(degrees):.1f} degrees along the walk ({len(place)} places of "
        f"{len(labels)} markers over {np.ptp(along):.1f} m, within {1e3 * off:.0f} mm of a line; 0.1 is usual): the "
        "vertical of the cameras is tilted (the L-frame did not lie flat when they were calibrated), and so are loads "
        "against the body; level the axes, unless the person walked on a ramp"
    ]


def _stands(time: FloatArray, place: FloatArray) -> FloatArray:
    """(s, 3) m, where one marker stood."""
    speed = np.linalg.norm(np.gradient(place, time, axis=0), axis=1)
    still = [
        place[first : last + 1].mean(axis=0)
        for first, last in runs(np.nan_to_num(speed, nan=np.inf) < _STILL_M_S)
        if span_s(time, first, last) >= _SHORTEST_S
    ]
    return np.array(still).reshape(-1, 3)
