"""Does the centre of pressure progress from heel to toe? Plates on which it runs backwards, or never moves.

On 11 fault-free walks and runs it is 43 to 148 mm farther forwards on the foot in the last third of a step than in the
first, in a drop jump 16 to 20 mm.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.foot_trajectories import FootTrajectory
from kinertia.diagnostics.evidence.plate_contacts import PlateContact
from kinertia.diagnostics.plates.heel_landing import lands_on_heels
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_BACKWARDS_M, _FORWARDS_M, _FIXED_M = -0.08, 0.05, 0.002
_USUAL_M = (0.043, 0.148)


def cop_progression(context: RecordingContext) -> Iterator[Finding]:
    """P251 and P252: plates whose centre of pressure never moves during a step (P251), or moves from toe to heel while
    on another plate it moves from heel to toe (P252).
    """
    plates, feet = context.plates, context.foot_trajectories
    if plates is None or feet is None or context.is_static or not lands_on_heels(context):
        return
    steps = [one for one in context.contacts if one.is_step]
    progression: dict[int, float] = {}
    for p in sorted({one.plate for one in steps}):
        own = [one for one in steps if one.plate == p]
        range_m = max(float(np.ptp(one.place, axis=0).max()) for one in own)
        if range_m < _FIXED_M:
            yield finding("P251", context.at(plate=plates.names[p]), range_m=Quantity(range_m, "m", limit=_FIXED_M))
        progression[p] = float(np.median([_progression_m(one, feet[one.foot]) for one in own]))
    if all(each <= _FORWARDS_M for each in progression.values()):
        return
    for p, each in progression.items():
        if each < _BACKWARDS_M:
            measured = Quantity(each, "m", limit=_BACKWARDS_M, usual=_USUAL_M)
            yield finding("P252", context.at(plate=plates.names[p]), progression_m=measured)


def _progression_m(contact: PlateContact, foot: FootTrajectory) -> float:
    """Return how much farther forwards (m) on its foot a load is in its last third than in its first."""
    ahead = foot.beyond(contact.time, contact.place)[0]
    third = max(len(ahead) // 3, 1)
    return float(np.median(ahead[-third:]) - np.median(ahead[:third]))
