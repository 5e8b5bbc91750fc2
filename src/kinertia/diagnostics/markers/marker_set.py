"""L10, L105, L107, L108 and S209: are the labels there that the marker set, and the joints' landmarks, need?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.errors import KinertiaError, MarkerSetError
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity
from kinertia.io.marker_set_file import nearest_preset
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
from kinertia.model.marker_set import (
    MarkerSet,
    fits_person,
    in_words,
    matches_labels,
    nearest_labels,
    no_marker_set,
    with_nearest,
)
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
    for assumption in assumptions(marks):
        labels = [label for name in assumption.lacking for label in marks.marker_set.landmarks.get(name, ())]
        absent = nearest_labels([label for label in labels if label not in marks.markers], list(marks.markers))
        yield finding(
            "L107",
            context.at(part=assumption.part),
            Severity.WARNING if assumption.of_leg else None,
            lacking=Quantity(", ".join(assumption.lacking)),
            instead=Quantity(assumption.instead),
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
    for departure in departures(marks):
        limit = departure.limit.apart if departure.between_sides else departure.limit.within
        yield finding(
            "S209",
            context.at(part=in_words(departure.part)),
            angle_rad=Quantity(abs(departure.angle_rad), "rad", limit=limit, usual=(0.0, departure.limit.usual)),
            axis=Quantity(departure.limit.name),
            how=Quantity(departure.how),
        )


@dataclass(frozen=True, eq=False)
class MarkerSetMatch:
    """Which labels of a marker set a recording has.

    Attributes:
        name: name of the set.
        fits: whether it is the recording's set; if not, it is the nearest preset.
        missing: labels of the set that the recording lacks, each with the most similar labels of `others`.
        n_labels: number of labels of the set.
        others: labels of the recording that are not in the set and stay unused.
        of_model: whether the set is the markers of an OpenSim model.
    """

    name: str
    fits: bool
    missing: dict[str, list[str]]
    n_labels: int
    others: tuple[str, ...]
    of_model: bool


def match_labels(labels: Sequence[str], marker_set: MarkerSet | None) -> tuple[MarkerSetMatch, MarkerSet | None]:
    """Match the labels to the set, or to the nearest preset; return the match, and the set if it is the recording's."""
    wanted = nearest_preset(labels) if marker_set is None else marker_set
    if not wanted.landmarks:
        fits = bool(set(wanted.labels) & set(labels))
    else:
        fits = fits_person(wanted, labels) if marker_set is None else matches_labels(wanted, labels)
    used = wanted if fits else None
    others = tuple(label for label in labels if label not in wanted.labels)
    missing = nearest_labels([label for label in wanted.labels if label not in labels], others)
    return MarkerSetMatch(
        wanted.name, used is not None, missing, len(wanted.labels), others, not wanted.landmarks
    ), used


@check("L101", "L102", "L103")
def labels_match(context: RecordingContext) -> Iterator[Finding]:
    """Report L101 to L103: no marker set fits, labels are missing, or labels are spelled differently (one finding
    each)."""
    match, used = match_labels(context.all_markers.labels, context.marker_set)
    if used is None:
        yield replace(no_marker_set(match.name, match.n_labels, match.missing), where=context.at())
        return
    if match.missing:
        yield finding(
            "L102",
            context.at(markers=tuple(match.missing)),
            missing=Quantity(float(len(match.missing)), "1"),
            name=Quantity(match.name),
            labels=Quantity(with_nearest(match.missing)),
        )
    for label, written in used.respelled.items():
        yield finding("L103", context.at(markers=(written,)), written=Quantity(written), label=Quantity(label))
