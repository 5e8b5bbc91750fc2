"""Finds out whether feet are seen from heel to forefoot and land on the heel, as loads are expected to."""

from kinertia.diagnostics.context import RecordingContext

_ENDS = (("heel",), ("metatarsal", "toe"))
_LEAST_LENGTH_M = 0.08
"""Less than from heel to forefoot of a child of four years."""


def lands_on_heels(context: RecordingContext) -> bool:
    """Return whether loads can be expected to progress from heel to toe: in strides that do not go backwards."""
    return context.has_strides and goes_forwards(context)


def goes_forwards(context: RecordingContext) -> bool:
    """Return whether loads can be expected between heel and toe: whole feet are visible and the person does not walk
    backwards."""
    return shows_whole_feet(context) and not context.walks_backwards


def shows_feet_equally(context: RecordingContext) -> bool:
    """Return whether the same markers of both feet are visible: else their lines from heel to toe differ."""
    if context.marker_set is None:
        return False
    landmarks, seen = context.marker_set.landmarks, context.seen_labels
    right, left = (
        [len(seen.intersection(landmarks.get(f"{name}_{side}", ()))) for end in _ENDS for name in end] for side in "rl"
    )
    return right == left


def shows_whole_feet(context: RecordingContext) -> bool:
    """Return whether heel and forefoot of both feet are visible: loads are between them, and foot off is not heel
    off."""
    feet, marker_set = context.foot_trajectories, context.marker_set
    if feet is None or marker_set is None:
        return False
    for side in "rl":
        for names in _ENDS:
            labels = {label for name in names for label in marker_set.landmarks.get(f"{name}_{side}", ())}
            if labels and not labels & context.seen_labels:
                return False
    return min(one.length_m for one in feet) > _LEAST_LENGTH_M
