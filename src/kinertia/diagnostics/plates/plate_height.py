"""Are the plates at the height of the feet? A centre of pressure above the soles falsifies every lever arm.

While a plate is loaded, the lowest marker of the foot on it is 7 to 51 mm above it: on 60 contacts of 20 people, from
standing children to runs in shoes.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.plate_contacts import PlateContact
from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import PlateLoads

_USUAL_M = (0.007, 0.051)
_LEAST_M = Limit(0.0, "m", usual=_USUAL_M)
_LOW = 10.0
"""Percentile of a marker's height: it is low for a part of a step only."""


@check("P249", unless=("M143",), height=_LEAST_M)
def plate_heights(context: PersonContext) -> Iterator[Finding]:
    """Report P249: plates, or centres of pressure in a file, above the lowest markers of all feet on them."""
    for trial in context.trials:
        for plate, (height_m, surface_m) in heights_on_plates(trial).items():
            if height_m - surface_m < _LEAST_M:
                yield finding(
                    "P249",
                    trial.at(plate=plate),
                    depth_m=Quantity(surface_m - height_m, "m", limit=-_LEAST_M, usual=(-_USUAL_M[1], -_USUAL_M[0])),
                    surface_m=Quantity(surface_m, "m"),
                )


def heights_on_plates(trial: RecordingContext) -> dict[str, tuple[float, float]]:
    """Return height (m) of the lowest marker of the feet on each loaded plate, in the step in which it is highest, and
    of the plate's surface; NaN where that is unknown."""
    plates = trial.recorded_plates
    lowest: dict[int, float] = {}
    for contact in () if plates is None else trial.contacts:
        height_m = _lowest_m(trial, contact)
        if height_m is not None:
            lowest[contact.plate] = max(height_m, lowest.get(contact.plate, -np.inf))
    return {} if plates is None else {plates.names[p]: (own, _surface_m(plates, p)) for p, own in lowest.items()}


def _surface_m(plates: PlateLoads, plate: int) -> float:
    """Return the height (m) of a plate by its corners or else by its centres of pressure; NaN where it is unknown."""
    if plates.corners is not None:
        return float(plates.corners[plate, :, 1].mean())
    return np.nan if plates.torques is None else plates.torques[plate].height_m


def _lowest_m(trial: RecordingContext, contact: PlateContact) -> float | None:
    """Return the height (m) of the lowest marker of the foot that loads the plate; None where none is visible."""
    if trial.feet is None:
        return None
    markers = trial.all_markers.cut(float(contact.time[0]), float(contact.time[-1]))
    heights = markers.select(trial.feet["rl"[contact.foot]]).positions[..., 1]
    shown = heights[:, np.isfinite(heights).any(axis=0)]
    return float(np.nanpercentile(shown, _LOW, axis=0).min()) if shown.size else None
