"""How finely were forces recorded, in size and in time? Rounded values, and filters that are far too strong.

On 26 recordings of nine laboratories forces have steps of 4.9 N at most (one plate behind a 12-bit converter), and no
plate reads negative forces for more than 3 ms next to a load.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.loaded_plates import loaded_wrenches
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import FloatArray

_COARSE_N, _COARSE_M = 7.5, 0.0075
"""Steps of 5 N, or of 5 mm, change joint moments by less than their SDs; of 10 N, or 10 mm, by up to twice
those."""
_FEWEST_SAMPLES, _FEWEST_VALUES, _OFF_STEP, _DECIMALS_N, _DECIMALS_M = 20, 3, 0.01, 3, 5
_OVERSHOOT_S, _OVERSHOOT_HZ_S = 0.06, 0.45
"""A Butterworth filter of second order, forth and back, overshoots for 0.06 s at 7 Hz and for 0.09 s at 5 Hz."""


def quantisation(context: RecordingContext) -> Iterator[Finding]:
    """Report P105, P106 and P108: forces, or centres of pressure, in coarse steps; forces spread in time by a
    filter."""
    plates = context.plates
    if plates is None:
        return
    for name, wrench in loaded_wrenches(plates):
        step_n = max(quantisation_n(values) for values in wrench[:, :3].T)
        if step_n > _COARSE_N:
            yield finding(
                "P105", context.at(plate=name), step_n=Quantity(step_n, "N", limit=_COARSE_N, usual=(0.0, 4.9))
            )
        point = centre_of_pressure(wrench)
        step_m = max(_step(point[:, axis], _DECIMALS_M) for axis in (0, 2))
        if step_m > _COARSE_M:
            yield finding("P106", context.at(plate=name), step_m=Quantity(step_m, "m", limit=_COARSE_M))
    for name, unloaded in zip(plates.names, plates.unloaded or (), strict=plates.unloaded is not None):
        if unloaded.overshoot_s > _OVERSHOOT_S:
            yield finding(
                "P108",
                context.at(plate=name),
                overshoot_s=Quantity(unloaded.overshoot_s, "s", limit=_OVERSHOOT_S, usual=(0.0, 0.003)),
                cutoff_hz=Quantity(_OVERSHOOT_HZ_S / unloaded.overshoot_s, "Hz"),
            )


def quantisation_n(values: FloatArray) -> float:
    """Return the quantisation step of forces (k,) along one axis, less their zero; 0 where they are continuous."""
    return _step(values, _DECIMALS_N)


def _step(values: FloatArray, decimals: int) -> float:
    distinct = np.unique(np.round(values, decimals))
    if len(values) < _FEWEST_SAMPLES or len(distinct) < _FEWEST_VALUES:
        return 0.0
    step = float(np.diff(distinct).min())
    steps = (distinct - distinct[0]) / step
    return step if np.abs(steps - np.round(steps)).max() < _OFF_STEP else 0.0
