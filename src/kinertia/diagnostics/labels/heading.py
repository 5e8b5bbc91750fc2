"""L106 and S311: which way does the person face, and which way does the person walk?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.landmarks import CLEAR, cosine, headings, horizontal, landmark_positions
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

_GOES_M = 0.5
_ASIS = ("asis_r", "asis_l")


def heading(context: RecordingContext) -> Iterator[Finding]:
    """L106: the sides of the pelvis are absent, or never visible together."""
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places = landmark_positions(context.all_markers, context.marker_set)
    if set(_ASIS) <= set(places) and np.isfinite(places["asis_r"] - places["asis_l"]).all(axis=1).any():
        return
    labels = tuple(label for name in _ASIS for label in context.marker_set.landmarks.get(name, ()))
    absent = [label for label in labels if label not in context.all_markers.labels]
    yield finding(
        "L106",
        context.at(markers=labels),
        absent=Quantity(float(len(absent)), "1"),
    )


def direction_of_travel(context: RecordingContext) -> Iterator[Finding]:
    """S311: the person walks where neither feet nor pelvis point.

    Where no markers show the front of either, the sides of the pelvis decide, whose labels may be swapped as well.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places = landmark_positions(context.all_markers, context.marker_set)
    known = headings(places)
    causes: tuple[str, ...] = ("walking backwards",)
    if not known and set(_ASIS) <= set(places):
        known = {"pelvis": np.cross([0.0, 1.0, 0.0], places["asis_r"] - places["asis_l"])}
        causes = ("walking backwards", "swapped left and right labels")
    forwards = _most_forwards(context.all_markers, known)
    if forwards < -CLEAR:
        yield finding("S311", context.at(), causes=causes, cosine=Quantity(forwards, "1", limit=-CLEAR))


def walks_backwards(markers: Markers, marker_set: MarkerSet) -> bool:
    """Whether somebody goes where neither feet nor pelvis point; not if nobody goes anywhere."""
    return _most_forwards(markers, headings(landmark_positions(markers, marker_set))) < -CLEAR


def _most_forwards(markers: Markers, known: dict[str, FloatArray]) -> float:
    """Of these headings the largest cosine to the way of the markers' middle; 0 where there is neither."""
    shown = np.asarray(np.isfinite(markers.positions).any(axis=(1, 2)))
    middle = np.nanmedian(markers.positions[shown], axis=1)
    if not known or len(middle) < 2 or np.linalg.norm(horizontal(middle[-1] - middle[0])) < _GOES_M:
        return 0.0
    way = np.broadcast_to(middle[-1] - middle[0], markers.positions[:, 0].shape)
    return max(cosine(each, way) for each in known.values())
