"""L105, L107, L108, S209: does the static trial show the landmarks that joints need, and legs that people have?"""

from collections.abc import Iterator
from dataclasses import replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.errors import KinertiaError, MarkerSetError
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.model.gait27 import build_gait27
from kinertia.model.joint_centres import (
    WAND_LIMITS,
    Landmarks,
    find_landmarks,
    hip_in_pelvis,
    knee,
    pelvis_frame,
    wand_rotation,
)
from kinertia.model.marker_set import in_words, nearest_labels, with_nearest
from kinertia.model.static_landmarks import ANKLE, FOOT, KNEE, assumptions, departures

_USUAL_HEIGHT_M, _ANY_SEX = 1.7, "male"
"""Whether landmarks suffice depends on neither."""


@check(
    "L105",
    "L107",
    "L108",
    "S206",
    "S209",
    unless=("L106", "M104"),
    knee=Limit(WAND_LIMITS["knee"].limit_rad, "rad", usual=(0.0, WAND_LIMITS["knee"].usual_rad)),
    ankle=Limit(WAND_LIMITS["ankle"].limit_rad, "rad", usual=(0.0, WAND_LIMITS["ankle"].usual_rad)),
    knee_axis=Limit(KNEE.within, "rad", usual=(0.0, KNEE.usual)),
    ankle_axis=Limit(ANKLE.within, "rad", usual=(0.0, ANKLE.usual)),
    ankle_from=Limit(ANKLE.centre, "rad"),
    ankle_apart=Limit(ANKLE.apart, "rad"),
    foot=Limit(FOOT.within, "rad", usual=(0.0, FOOT.usual)),
    foot_from=Limit(FOOT.centre, "rad"),
)
def landmarks(context: RecordingContext) -> Iterator[Finding]:
    """Report why no model can be built from a static trial (L105, S206), or each missing part that a model can do
    without (L107), wands that are not used (L108) and axes that no person has (S209).

    Errors that are not about markers concern stature, which other questions cover.
    """
    if context.marker_set is None or not context.marker_set.landmarks:
        return
    height_m = context.height_m or context.recording.height_m or _USUAL_HEIGHT_M
    try:
        build_gait27(context.recording, context.marker_set, height_m, _ANY_SEX)
        marks = find_landmarks(context.recording, context.marker_set)
        yield from _assumed(context, marks)
        yield from _wands(context, marks)
        yield from _legs(context, marks)
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


def _wands(context: RecordingContext, marks: Landmarks) -> Iterator[Finding]:
    pelvis, origin, width, depth = pelvis_frame(marks)
    for side in "rl":
        hip_at = origin + pelvis @ hip_in_pelvis(width, depth, "bell", side)
        for name, proximal in (("knee", hip_at), ("ankle", knee(marks, hip_at, side)[0])):
            limit, turned = WAND_LIMITS[name], wand_rotation(marks, name, proximal, side)
            if turned is not None and abs(turned) > limit.limit_rad:
                yield finding(
                    "L108",
                    context.at(
                        part=in_words(f"{name}_{side}"), markers=marks.marker_set.landmarks[f"{limit.wand}_{side}"]
                    ),
                    rotation_rad=Quantity(abs(turned), "rad", limit=limit.limit_rad, usual=(0.0, limit.usual_rad)),
                    direction=Quantity("outwards" if turned > 0 else "inwards"),
                    line=Quantity(limit.line),
                )


def _legs(context: RecordingContext, marks: Landmarks) -> Iterator[Finding]:
    for one in departures(marks):
        limit = one.limit.apart if one.between_sides else one.limit.within
        yield finding(
            "S209",
            context.at(part=in_words(one.part)),
            angle_rad=Quantity(abs(one.angle_rad), "rad", limit=limit, usual=(0.0, one.limit.usual)),
            axis=Quantity(one.limit.name),
            how=Quantity(one.how),
        )
