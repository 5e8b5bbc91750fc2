"""Draws the labelled markers of a recording as a figure to turn, before there is any model."""

from collections.abc import Sequence

import numpy as np

from kinertia.model.marker_set import MarkerSet
from kinertia.report.scene import Scene, plate_corners
from kinertia.trial.data import Recording

_CHAIN = (
    ("pelvis", "torso"),
    *(
        (parent.format(side), f"{child}_{side}")
        for side in "rl"
        for parent, child in (
            ("pelvis", "thigh"),
            ("thigh_{}", "shank"),
            ("shank_{}", "foot"),
            ("torso", "upper_arm"),
            ("upper_arm_{}", "forearm"),
        )
    ),
)
"""Segments of a marker set that are drawn as joined, by the middle of their markers."""


def marker_scene(recording: Recording, marker_set: MarkerSet | None, most_frames: int) -> Scene:
    """Show the markers of the set with their names, in at most `most_frames` frames.

    Each is joined to the middle of its segment's markers, and so are neighbouring segments: a swapped or drifting label
    draws a long line. Without a marker set all markers are shown, and nothing is joined.
    """
    markers = recording.markers
    if marker_set is not None:
        markers = markers.select([label for label in marker_set.labels if label in markers.labels])
    chosen = slice(None, None, -(-len(markers.time) // most_frames))
    positions = markers.positions[chosen]
    segments: dict[str, list[int]] = {}
    if marker_set is not None:
        for name, labels in marker_set.segments.items():
            segments[name] = [markers.labels.index(label) for label in labels if label in markers.labels]
    segments = {name: rows for name, rows in segments.items() if rows}
    middles = [_middle(positions[:, rows]) for rows in segments.values()]
    names = list(segments)
    bones, sides = [], []
    for k, (name, rows) in enumerate(segments.items()):
        bones += [(row, len(markers.labels) + k) for row in rows if len(rows) > 1]
        sides += [_side(name) for _ in rows if len(rows) > 1]
    for parent, child in _CHAIN:
        if parent in segments and child in segments:
            bones.append((len(markers.labels) + names.index(parent), len(markers.labels) + names.index(child)))
            sides.append(_side(child))
    pelvis = segments.get("pelvis") or list(range(len(markers.labels)))
    return Scene(
        time=markers.time[chosen],
        centre=_bridged(_middle(positions[:, pelvis])),
        bones=np.array(bones, dtype=int).reshape(-1, 2),
        sides=tuple(sides),
        points=np.concatenate([positions, *(middle[:, None] for middle in middles)], axis=1),
        measured=positions,
        labels=markers.labels,
        plates=plate_corners(None if recording.plates is None else recording.plates.corners),
    )


def _side(segment: str) -> str:
    return segment[-1] if segment.endswith(("_r", "_l")) else ""


def _middle(positions: np.ndarray) -> np.ndarray:
    """Return the mean (n, 3) of the visible markers (n, m, 3); NaN where none is."""
    seen = np.isfinite(positions).all(axis=2)
    total = np.where(seen[..., None], positions, 0.0).sum(axis=1)
    with np.errstate(invalid="ignore"):
        result: np.ndarray = total / seen.sum(axis=1)[:, None]
        return result


def _bridged(path: np.ndarray) -> np.ndarray:
    """Return the path (n, 3) with straight lines across gaps; the origin where nothing is known."""
    known = np.flatnonzero(np.isfinite(path).all(axis=1))
    if not len(known):
        return np.zeros_like(path)
    at = np.arange(len(path))
    columns: Sequence[np.ndarray] = [np.interp(at, known, path[known, k]) for k in range(3)]
    return np.stack(columns, axis=1)
