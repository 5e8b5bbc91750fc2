"""M10: are the markers visible? Those that never are, rarely, or not for long; and segments without any."""

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.model.marker_set import in_words
from kinertia.motion.kinematics import LONGEST_BRIDGE_S
from kinertia.trial.data import Markers
from kinertia.trial.marker_quality import visibility

_RARE = 0.5
_DISPENSABLE = ("upper_arm", "forearm")
"""Arms need not be seen."""


def visible(context: RecordingContext) -> Iterator[Finding]:
    """Report M101 to M104: one finding per marker (M102 and M103 over the measured window), M104 one per bare
    segment."""
    for one in visibility(context.markers):
        if one.share == 0.0:
            yield finding("M101", context.at(markers=(one.label,)), share=Quantity(0.0, "1"))
    for one in visibility(_in_window(context)):
        where = context.at(markers=(one.label,))
        if 0.0 < one.share < _RARE:
            yield finding("M102", where, share=Quantity(one.share, "1", limit=_RARE))
        elif one.share > 0.0 and one.longest_gap_s > LONGEST_BRIDGE_S:
            yield finding("M103", where, gap_s=Quantity(one.longest_gap_s, "s", limit=LONGEST_BRIDGE_S))
    yield from _bare_segments(context)


def _in_window(context: RecordingContext) -> Markers:
    """Return the frames that a fit would use; those around loads on plates where they are unknown."""
    windows = () if context.trial is None else context.trial.windows()
    return context.markers.cut(*windows[0]) if windows else context.measured_markers


def _bare_segments(context: RecordingContext) -> Iterator[Finding]:
    """Report M104: pelvis, legs, feet without markers, the trunk if the static trial shows it; of an OpenSim model,
    feet."""
    marker_set = context.marker_set
    if marker_set is None:
        return
    trunk = set(marker_set.segments.get("torso", ()))
    markers = context.measured_markers
    seen = {label for label, shown in zip(markers.labels, markers.seen.T, strict=True) if shown.any()}
    trunk_known = context.static is not None and trunk & context.static.seen_labels
    for segment, labels in marker_set.segments.items():
        if marker_set.landmarks:
            needed = bool(labels) and not segment.startswith(_DISPENSABLE) and (segment != "torso" or trunk_known)
        else:
            needed = segment in ("foot_r", "foot_l")
        if needed and not set(labels) & seen:
            expected = ", ".join(labels) or "markers of the model"
            count = Quantity(float(len(labels)), "1")
            yield finding("M104", context.at(part=in_words(segment)), expected=count, labels=Quantity(expected))
