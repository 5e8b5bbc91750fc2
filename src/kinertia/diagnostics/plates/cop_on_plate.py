"""Do centres of pressure lie on their plate?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.plate_contacts import COP_MIN_FORCE_N, cop_horizontal
from kinertia.diagnostics.evidence.plate_edges import beyond_edges
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import PlateLoads

OFF_PLATE_SHARE = 0.05
"""Share of the load with its centre of pressure off the plate that is reported; half of it is wrong."""
_MOST_SHARE = 0.5


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
