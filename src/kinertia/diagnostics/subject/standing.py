"""Is there a static trial, and does it show a person who stands with both feet flat?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.estimation.simultaneous.instruments.priors import JOINT_CENTRE_SD_M, WITHOUT_STATIC
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.motion.stance_pose import hidden_landmarks
from kinertia.trial.marker_quality import LEAST_WALK_M, STANDING_RANGE_M, still_span_s

_FLAT_M = Limit(0.04, "m", usual=(0.0, 0.012))
"""Heels, and metatarsals, of seven people who stand are up to 12 mm higher on one side than on the other."""


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
