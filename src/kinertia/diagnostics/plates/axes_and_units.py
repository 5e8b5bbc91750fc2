"""Are axes and units of the forces right, going by the plates alone?"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.force_mass import loaded_wrenches
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import free_moment
from kinertia.trial.data import LOAD_THRESHOLD_N, PlateLoads

_VERTICAL_SHARE = 0.7
"""Share of the largest force; a foot pushes sideways and backwards by less."""
_WEAKEST_N = Limit(0.3)
"""Smallest peak of a load in kN, or in multiples of body weight."""
_LONGEST_ARM_M, _FEWEST = Limit(0.15, "m", usual=(0.0, 0.04)), 10
"""Free moment over vertical force; so many samples under load, at least."""


@check("P201", "P202", "P203", weakest=_WEAKEST_N, threshold=Limit(LOAD_THRESHOLD_N), lever_arm=_LONGEST_ARM_M)
def axes_and_units(context: RecordingContext) -> Iterator[Finding]:
    """Report P201 to P203: forces in other axes or other units, going by the plates alone."""
    plates = context.plates
    if plates is None:
        return
    x, y, z = (float(value) for value in np.abs(plates.force).max(axis=(0, 1), initial=0.0))
    if y < _VERTICAL_SHARE * max(x, z):
        yield finding(
            "P201",
            context.at(**context.along(0 if x > z else 2)),
            peak_n=Quantity((x, y, z), "N"),
            vertical=Quantity(context.recording.vertical),
        )
    peak = _peak_of_weak_loads(plates)
    if peak is not None:
        yield finding(
            "P202",
            context.at(),
            peak_n=Quantity(peak, "N", limit=LOAD_THRESHOLD_N),
            unit=Quantity("kN or multiples of body weight"),
        )
    for name, wrench in loaded_wrenches(plates, _FEWEST):
        lever_arm_m = float(np.median(np.abs(free_moment(wrench)) / wrench[:, 1]))
        if lever_arm_m > _LONGEST_ARM_M:
            yield finding(
                "P203",
                context.at(plate=name),
                lever_arm_m=Quantity(lever_arm_m, "m", limit=_LONGEST_ARM_M, usual=_LONGEST_ARM_M.usual),
            )


def _peak_of_weak_loads(plates: PlateLoads) -> float | None:
    """Return the peak (N) where all loads are too small for a person and yet come and go as loads do; else None.

    A plate that no one steps on shows noise of up to some newtons, and perhaps an offset or a drift.
    """
    unloaded = plates.unloaded or ()
    peak = max((one.peak_n for one in unloaded), default=0.0)
    if plates.force.any() or not _WEAKEST_N < peak < LOAD_THRESHOLD_N:
        return None
    return peak if any(one.like_steps and one.peak_n > _WEAKEST_N for one in unloaded) else None
