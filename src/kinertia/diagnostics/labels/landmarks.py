"""L105, L107: does the static trial show the landmarks that the model's joints need?"""

from collections.abc import Iterator
from dataclasses import replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.errors import KinertiaError, MarkerSetError
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.model.assumptions import assumptions
from kinertia.model.gait27 import build_gait27
from kinertia.model.joint_centres import Landmarks, find_landmarks
from kinertia.model.marker_set import nearest_labels, with_nearest

_USUAL_HEIGHT_M, _ANY_SEX = 1.7, "male"
"""Whether landmarks suffice depends on neither."""


def landmarks(context: RecordingContext) -> Iterator[Finding]:
    """Report L105, S206 or L107: why no model can be built from a static trial (L105, S206), and each missing part that
    a model can do without (L107).

    Errors that are not about markers concern stature, which other questions cover.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    height_m = context.height_m or context.recording.height_m or _USUAL_HEIGHT_M
    try:
        build_gait27(context.recording, context.marker_set, height_m, _ANY_SEX)
        yield from _assumed(context, find_landmarks(context.recording, context.marker_set))
    except MarkerSetError as error:
        if error.finding is None:
            raise
        yield replace(error.finding, where=replace(error.finding.where, trial=context.name))
    except KinertiaError:
        return


def _assumed(context: RecordingContext, marks: Landmarks) -> Iterator[Finding]:
    for one in assumptions(marks):
        labels = [label for name in one.lacking for label in marks.marker_set.landmarks.get(name, ())]
        absent = nearest_labels([label for label in labels if label not in marks.markers], list(marks.markers))
        yield finding(
            "L107",
            context.at(part=one.part),
            Severity.WARNING if one.of_leg else None,
            lacking=Quantity(", ".join(one.lacking)),
            instead=Quantity(one.instead),
            labels=Quantity(with_nearest(absent) or "not in the marker set"),
        )
