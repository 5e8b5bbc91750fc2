"""Does the load travel from heel to toe? Plates whose centre of pressure runs backwards, or stands still.

On 11 sound walks and runs it is 43 to 148 mm farther forwards on the foot in the last third of a step than in the
first, in a drop jump 16 to 20 mm.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.diagnostics.evidence.foot_ways import FootWay
from kinertia.diagnostics.evidence.load_contacts import Contact, load_points
from kinertia.trial.data import FloatArray, PlateLoads

_BACKWARDS_M, _FORWARDS_M, _STILL_M = -0.08, 0.05, 0.002


def load_travel_doubts(plates: PlateLoads, contacts: Sequence[Contact], ways: tuple[FootWay, FootWay]) -> list[str]:
    """Plates on which the load of a step goes from toe to heel, while on another it goes from heel to toe, or on which
    it does not move at all.
    """
    point = load_points(plates)
    steps = [(one, point[np.searchsorted(plates.time, one.time), one.plate]) for one in contacts if one.is_step]
    doubts = []
    for p in sorted({one.plate for one, _ in steps}):
        if max(float(np.ptp(place, axis=0).max()) for one, place in steps if one.plate == p) < _STILL_M:
            doubts.append(
                f"the centre of pressure of {plates.names[p]} never moves while somebody steps on it: a fixed point "
                "(the plate's middle) was written in its place; export the centres of pressure that were measured"
            )
    travel = {
        p: [_travel_m(one, place, ways) for one, place in steps if one.plate == p] for p, _ in enumerate(plates.names)
    }
    middle = {p: float(np.median(each)) for p, each in travel.items() if each}
    back = [p for p, each in middle.items() if each < _BACKWARDS_M]
    if back and any(each > _FORWARDS_M for each in middle.values()):
        doubts.append(
            f"the centre of pressure of {' and '.join(plates.names[p] for p in back)} goes from toe to heel, by "
            f"{-1e3 * min(middle.values()):.0f} mm, and from heel to toe on the other plates: it is mirrored; correct "
            "the sign of that plate's moment, or its axes, and export again"
        )
    return doubts


def _travel_m(contact: Contact, place: FloatArray, ways: tuple[FootWay, FootWay]) -> float:
    """How much farther forwards on its foot a load is in its last third than in its first."""
    ahead = ways[contact.foot].beyond(contact.time, place)[0]
    third = max(len(ahead) // 3, 1)
    return float(np.median(ahead[-third:]) - np.median(ahead[:third]))
