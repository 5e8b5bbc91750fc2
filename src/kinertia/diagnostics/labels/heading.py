"""L106 and S311: which way does the person face and walk?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.landmarks import CLEAR, most_forwards
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_ASIS = ("asis_r", "asis_l")


def heading(context: RecordingContext) -> Iterator[Finding]:
    """Report L106: the sides of the pelvis are absent, or never visible together."""
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places = context.landmark_positions
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
    """Report S311: the person walks where neither feet nor pelvis point.

    Where no markers show the front of either, the sides of the pelvis decide, whose labels may be swapped as well.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    places, forwards = context.landmark_positions, context.most_forwards
    causes: tuple[str, ...] = ("walking backwards",)
    if not context.headings and set(_ASIS) <= set(places):
        across = {"pelvis": np.cross([0.0, 1.0, 0.0], places["asis_r"] - places["asis_l"])}
        forwards = most_forwards(context.all_markers, across)
        causes = ("walking backwards", "swapped left and right labels")
    if forwards < -CLEAR:
        yield finding("S311", context.at(), causes=causes, cosine=Quantity(forwards, "1", limit=-CLEAR))
