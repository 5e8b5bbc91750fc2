"""Whether loads can be expected to go from heel to toe: both ends of both feet are seen, and nobody walks backwards."""

from __future__ import annotations

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.labels.body_sides import walks_backwards

_ENDS = (("heel",), ("metatarsal", "toe"))


def lands_on_heels(context: RecordingContext) -> bool:
    """What is usual of loads under feet is of people who land on the heel; between other markers than those of heel and
    forefoot is no place to expect a load.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return True
    return _shows_whole_feet(context) and not walks_backwards(context.all_markers, context.marker_set)


def _shows_whole_feet(context: RecordingContext) -> bool:
    assert context.marker_set is not None
    landmarks = context.marker_set.landmarks
    markers = context.all_markers
    shown = {label for label, seen in zip(markers.labels, markers.seen.T, strict=True) if seen.any()}
    for side in "rl":
        for names in _ENDS:
            labels = {label for name in names for label in landmarks.get(f"{name}_{side}", ())}
            if labels and not labels & shown:
                return False
    return True
