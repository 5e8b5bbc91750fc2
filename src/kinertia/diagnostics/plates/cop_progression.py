"""Does the centre of pressure progress from heel to toe? Plates on which it runs backwards, or never moves.

From the first third of a step to the last it moves forwards on the foot by 0.06 to 0.82 of the distance from heel to
forefoot in the walks and runs of 14 people, most of them children (in a drop jump by 16 to 20 mm), and by -0.37 or less
on a plate that is mirrored along the walk. People who land on the toes also push off from them, and a load that both
feet bear moves from foot to foot: neither counts.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import PlateContact
from kinertia.diagnostics.plates.heel_landing import heel_steps
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_FIXED_M = 0.002
_BACKWARDS, _FORWARDS, _USUAL = -0.35, 0.25, (0.06, 0.82)
"""Shares of the distance from heel to forefoot."""


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
