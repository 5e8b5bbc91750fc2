"""Does the static trial show a person who stands on the floor with both feet flat?"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.plates.plate_height import heights_on_plates
from kinertia.diagnostics.runner import check
from kinertia.estimation.simultaneous.instruments.priors import JOINT_CENTRE_SD_M, WITHOUT_STATIC
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.motion.stance_pose import hidden_landmarks
from kinertia.trial.marker_quality import LEAST_WALK_M, STANDING_RANGE_M, still_span_s

_LOWEST_M, _HIGHEST_M = Limit(0.005, "m", usual=(0.023, 0.044)), Limit(0.050, "m")
"""A marker's own radius is 5 mm and more: one beside a small toe was 5.7 mm above the floor. Soles are under both feet,
and markers on the side of a foot are low.

Usual is what fourteen people of eight laboratories have, barefoot and in running shoes. On top of shoes markers are 53
to 60 mm above the floor while standing, but 44 to 48 mm in motion.
"""
_FLAT_M = Limit(0.04, "m", usual=(0.0, 0.012))
"""Heels, and metatarsals, of seven people who stand are up to 12 mm higher on one side than on the other."""
_WHILE_STANDING, _IN_MOTION = 50.0, 10.0
"""Percentiles of a marker's height: in motion it is as high as on standing feet for a part of the time only."""


@check("S201", walk=Limit(LEAST_WALK_M, "m"))
def standing(context: RecordingContext) -> Iterator[Finding]:
    """Report S201: a person who walks in the static trial, with the part in which they stand."""
    if context.travel.kind != "walks":
        return
    distance = Quantity(context.travel.distance_m, "m", limit=LEAST_WALK_M, usual=(0.0, STANDING_RANGE_M))
    span = still_span_s(context.markers)
    action = "Give the standing trial, or none"
    if span is not None:
        action = f"Use the part in which the person stands: window_s = [{span[0]:.2f}, {span[1]:.2f}] under [model]"
    yield finding("S201", context.at(span_s=span), distance_m=distance, action=Quantity(action))


@check("S207", "S208")
def no_static(context: PersonContext) -> Iterator[Finding]:
    """Report S207: there is neither a static trial nor a model, and a walk replaces them; S208: no walk can."""
    unread = any(one.rule.stage == "file" and one.where.trial is None for one in context.found)
    if not context.trials or context.standing or context.model or context.files_only or unread:
        return
    yield finding("S207", centre_sd_m=Quantity(WITHOUT_STATIC * JOINT_CENTRE_SD_M, "m"))
    measured = [one.recording for one in context.trials if one.recording.plates is not None]
    if measured and context.marker_set and (hidden := hidden_landmarks(measured[0].markers, context.marker_set)):
        yield finding("S208", landmarks=Quantity(", ".join(hidden)))


@check("M143", lowest=_LOWEST_M, highest=_HIGHEST_M)
def floor(context: PersonContext) -> Iterator[Finding]:
    """Report M143: feet that stand above or below the floor, by the lowest marker of toes, metatarsals and heels.

    It is an INFO where the trials show the floor, or a plate, at its height: the person then stands on something, or in
    thick soles.
    """
    static = context.static
    lowest = None if static is None else _lowest(static, _WHILE_STANDING)
    if static is None or lowest is None:
        return
    label, height_m = lowest
    low, high = _LOWEST_M, _HIGHEST_M
    if low <= height_m <= high:
        return
    in_trials = [own for trial in context.trials for own in _heights_in_motion(trial)]
    shared = all(own_m < low if height_m < low else own_m > high for own_m in in_trials)
    height = Quantity(height_m, "m", limit=low if height_m < low else high, usual=_LOWEST_M.usual)
    found = finding("M143", static.at(markers=(label,)), height_m=height)
    yield found if shared else replace(found, severity=Severity.INFO)


def _heights_in_motion(trial: RecordingContext) -> list[float]:
    """Return how high (m) the lowest foot marker is above each plate, and above the floor; empty if unknown."""
    on_plates = [lowest - surface for lowest, surface in heights_on_plates(trial).values()]
    lowest = _lowest(trial, _IN_MOTION)
    return [own for own in (*on_plates, *([] if lowest is None else [lowest[1]])) if np.isfinite(own)]


def _lowest(context: RecordingContext, percentile: float) -> tuple[str, float] | None:
    """Return label and height (m) of the lowest foot marker; None where heels or metatarsals are no landmarks."""
    if context.marker_set is None:
        return None
    names = [f"{name}_{side}" for name in ("heel", "metatarsal", "toe") for side in "rl"]
    of_landmark = [context.marker_set.landmarks.get(name, ()) for name in names]
    present = context.all_markers.labels
    labels = list(dict.fromkeys(label for own in of_landmark for label in own if label in present))
    heights = context.all_markers.select(labels).positions[..., 1]
    shown = np.isfinite(heights).any(axis=0)
    if not all(of_landmark[:4]) or not shown.any():
        return None
    each = np.where(shown, np.nanpercentile(np.where(shown, heights, 0.0), percentile, axis=0), np.inf)
    lowest = int(np.argmin(each))
    return labels[lowest], float(each[lowest])


@check("S202", apart=_FLAT_M)
def flat_feet(context: RecordingContext) -> Iterator[Finding]:
    """Report S202: a foot that is not on the floor like the other; foot axes assume that the foot is flat on the
    floor."""
    if context.marker_set is None:
        return
    apart = {}
    for name in ("heel", "metatarsal"):
        labels = (context.marker_set.landmarks.get(f"{name}_{side}", ())[:1] for side in "rl")
        heights = [context.all_markers.arranged(own)[..., 1] for own in labels]
        if all(np.isfinite(each).any() for each in heights):
            right_m, left_m = (float(np.nanmedian(each)) for each in heights)
            apart[name] = right_m - left_m
    if not apart:
        return
    landmark, higher_m = max(apart.items(), key=lambda one: abs(one[1]))
    if abs(higher_m) >= _FLAT_M:
        yield finding(
            "S202",
            context.at(part="right foot" if higher_m > 0 else "left foot"),
            difference_m=Quantity(abs(higher_m), "m", limit=_FLAT_M, usual=_FLAT_M.usual),
            landmark=Quantity(landmark),
        )
