"""Do centres of pressure lie on their plate, and progress from heel to toe where feet land on the heel?

From the first third of a step to the last it moves forwards on the foot by 0.06 to 0.82 of the distance from heel to
forefoot in the walks and runs of 14 people, most of them children (in a drop jump by 16 to 20 mm), and by -0.37 or less
on a plate that is mirrored along the walk. People who land on the toes also push off from them, and a load that both
feet bear moves from foot to foot: neither counts.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import COP_MIN_FORCE_N, PlateContact, cop_horizontal
from kinertia.diagnostics.evidence.plate_edges import beyond_edges
from kinertia.diagnostics.evidence.shared_and_stray_loads import FOOT_ENDS
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import PlateLoads

_FIXED_M = Limit(0.002, "m")
_USUAL = (0.06, 0.82)
_BACKWARDS, _FORWARDS = Limit(-0.35, usual=_USUAL), Limit(0.25)
"""Shares of the distance from heel to forefoot."""
OFF_PLATE_SHARE = Limit(0.05)
"""Share of the load with its centre of pressure off the plate that is reported; half of it is wrong."""
_MOST_SHARE = Limit(0.5)


@check("P251", "P252", unless=needs.LOADS_UNDER_FEET, fixed=_FIXED_M, backwards=_BACKWARDS, forwards=_FORWARDS)
def cop_progression(context: RecordingContext) -> Iterator[Finding]:
    """Report P251 and P252: plates whose centre of pressure never moves during a step (P251), or moves from toe to heel
    while on another plate it moves from heel to toe (P252).
    """
    plates, feet = context.plates, context.foot_trajectories
    if plates is None or feet is None or context.is_static:
        return
    steps = [one for one in heel_steps(context) if one.is_step]
    progression: dict[int, float] = {}
    for p in sorted({one.plate for one in steps}):
        own = [one for one in steps if one.plate == p]
        range_m = max(float(np.ptp(one.place, axis=0).max()) for one in own)
        if range_m < _FIXED_M:
            yield finding("P251", context.at(plate=plates.names[p]), range_m=Quantity(range_m, "m", limit=_FIXED_M))
        progression[p] = float(np.median([_progression_m(one, feet[one.foot]) for one in own]))
    length_m = float(np.mean([one.length_m for one in feet]))
    if all(each <= _FORWARDS * length_m for each in progression.values()):
        return
    usual = (_USUAL[0] * length_m, _USUAL[1] * length_m)
    for p, each in progression.items():
        if each < _BACKWARDS * length_m:
            measured = Quantity(each, "m", limit=_BACKWARDS * length_m, usual=usual)
            yield finding("P252", context.at(plate=plates.names[p]), progression_m=measured)


def _progression_m(contact: PlateContact, foot: FootTrajectory) -> float:
    """Return how much farther forwards (m) on its foot a load is in its last third than in its first."""
    ahead = foot.beyond(contact.time, contact.place)[0]
    third = max(len(ahead) // 3, 1)
    return float(np.median(ahead[-third:]) - np.median(ahead[:third]))


def goes_forwards(context: RecordingContext) -> bool:
    """Return whether loads can be expected between heel and toe: whole feet are visible and the person does not walk
    backwards."""
    return context.shows_whole_feet and not context.walks_backwards


def heel_steps(context: RecordingContext) -> list[PlateContact]:
    """Return the loads that can be expected to progress from heel to toe: of one foot that does not land on its
    forefoot, in strides that do not go backwards."""
    if not context.has_strides or not goes_forwards(context):
        return []
    return [one for one in one_foot_loads(context) if not one.trajectory.lands_on_forefoot(one.start_s, one.end_s)]


def one_foot_loads(context: RecordingContext) -> list[PlateContact]:
    """Return the loads without those that both feet bear on one plate; if these seem to be most, the loads are at a
    wrong position instead, and count."""
    shared = {id(one.contact) for one in context.shared_loads}
    own = [one for one in context.contacts if id(one) not in shared]
    return own if 2 * len(own) >= len(context.contacts) else list(context.contacts)


def shows_feet_equally(context: RecordingContext) -> bool:
    """Return whether the same markers of both feet are visible: else their lines from heel to toe differ."""
    if context.marker_set is None:
        return False
    landmarks, seen = context.marker_set.landmarks, context.seen_labels
    right, left = (
        [len(seen.intersection(landmarks.get(f"{name}_{side}", ()))) for end in FOOT_ENDS for name in end]
        for side in "rl"
    )
    return right == left


@check("P245", unless=("P204",), off_plate=OFF_PLATE_SHARE, most=_MOST_SHARE)
def cop_on_plate(context: RecordingContext) -> Iterator[Finding]:
    """Report P245: loads that act outside the corners of their plate."""
    if context.plates is None:
        return
    for p, name in enumerate(context.plates.names):
        off = off_plate(context.plates, p)
        if off is not None and off[0] > OFF_PLATE_SHARE:
            severity = Severity.ERROR if off[0] > _MOST_SHARE else None
            share = Quantity(off[0], "1", limit=OFF_PLATE_SHARE)
            yield finding("P245", context.at(plate=name), severity, share=share, distance_m=Quantity(off[1], "m"))


def off_plate(plates: PlateLoads, p: int) -> tuple[float, float] | None:
    """Return the share of the load of plate `p`, where it is reliable, whose centre of pressure is off it, and how far
    (m, 95th percentile; 0 where none is); None where the file has no corners or nothing is loaded.
    """
    loaded = plates.force[:, p, 1] > COP_MIN_FORCE_N
    if plates.corners is None or not loaded.any():
        return None
    beyond = beyond_edges(plates.corners[p], cop_horizontal(plates)[loaded, p])
    off = beyond > 0
    load = plates.force[loaded, p, 1]
    return float(load[off].sum() / load.sum()), float(np.percentile(beyond[off], 95)) if off.any() else 0.0
