"""How finely were forces recorded, in size and in time? Rounded values, and filters that are far too strong.

On 26 recordings of nine laboratories forces have steps of 4.9 N at most (one plate behind a 12-bit converter), and no
plate reads less than nothing for more than 3 ms beside a load.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.sampled_time import runs

_COARSE_N, _COARSE_M = 7.5, 0.0075
"""Steps of 5 N, or of 5 mm, change joint moments by less than their deviations; of 10 N, or 10 mm, by up to twice
those."""
_FEWEST_SAMPLES, _FEWEST_VALUES, _OFF_STEP, _DECIMALS_N, _DECIMALS_M = 20, 3, 0.01, 3, 5
_PULLED_SHARE, _BESIDE_S, _WITHIN_S, _LONGEST_S, _FEWEST_BESIDE_S = 0.005, 0.04, 0.3, 0.2, 0.15
"""Of a load's peak; how near to the load that begins; how far is looked, and for how long it lasts at most: a zero that
is wrong, or the load of another plate, lasts longer."""
_SHORTEST_LOAD_S, _LEAST_LOAD_N, _BRIDGED_S = 0.15, 200.0, 0.05
_RINGS_S, _RINGING_HZ_S = 0.06, 0.45
"""A Butterworth filter of second order, forth and back, rings for 0.06 s at 7 Hz and for 0.09 s at 5 Hz."""


def ringing_s(time: FloatArray, vertical: FloatArray) -> float:
    """For how long a plate reads less than nothing just before feet land and just after they leave; 0 where it does not
    do both: nobody pulls on a plate, but a filter without delay smears a load so.

    Args:
        time, vertical: (k,) s and N, as read.
    """
    peak = float(vertical.max(initial=0.0))
    if len(time) < 2 or peak < _LEAST_LOAD_N:
        return 0.0
    step = round(float(np.median(np.diff(time))), 9)
    landings: list[float] = []
    leavings: list[float] = []
    loads = _loads(vertical > LOAD_THRESHOLD_N, _BRIDGED_S / step)
    for k, (first, last) in enumerate(loads):
        if (last - first) * step < _SHORTEST_LOAD_S:
            continue
        before = slice(loads[k - 1][1] + 1 if k else 0, first)
        after = slice(last + 1, loads[k + 1][0] if k + 1 < len(loads) else len(vertical))
        for beside, found in ((vertical[before][::-1], landings), (vertical[after], leavings)):
            if len(beside) * step >= _FEWEST_BESIDE_S:
                found.append(_pulled_s(beside[: int(_WITHIN_S / step)], peak, step))
    if not landings or not leavings:
        return 0.0
    return float(min(np.median(landings), np.median(leavings)))


def ringing_doubts(plates: PlateLoads) -> list[str]:
    """Forces that were low-passed so much that loads are smeared; empty where they were not, or where that was cut."""
    idle = plates.idle or ()
    rings = {name: one.rings_s for name, one in zip(plates.names, idle, strict=bool(idle)) if one.rings_s > _RINGS_S}
    if not rings:
        return []
    lasts_s = max(rings.values())
    return [
        f"{' and '.join(rings)}: the vertical force is below zero for {1e3 * lasts_s:.0f} ms just before feet land and "
        "just after they leave, where nobody can pull: the forces were low-passed at about "
        f"{_RINGING_HZ_S / lasts_s:.0f} Hz, which smears them over both feet; export them unfiltered, or low-passed at "
        "20 Hz and more: a fit filters them itself"
    ]


def rounded_force_doubts(plates: PlateLoads) -> list[str]:
    """Forces, or centres of pressure, that come in coarse steps; empty where they do not."""
    doubts = []
    if coarse := _coarse(plates, _coarsest_n, _COARSE_N):
        doubts.append(
            f"the forces of {' and '.join(coarse)} come in steps of {max(coarse.values()):.3g} N: they were rounded, "
            "or a converter of few bits has far too large a range; joint moments are as coarse; export the forces with "
            "more digits, or choose a smaller range"
        )
    if places := _coarse(plates, _coarsest_m, _COARSE_M):
        doubts.append(
            f"the centres of pressure of {' and '.join(places)} come in steps of {1e3 * max(places.values()):.3g} mm: "
            "they were rounded (metres with two decimals, centimetres with none); joint moments are as coarse; export "
            "them with more digits"
        )
    return doubts


def force_step_n(values: FloatArray) -> float:
    """What forces (k,) along one axis are multiples of, but for their zero; 0 where they take any value."""
    return _step(values, _DECIMALS_N)


def _coarse(plates: PlateLoads, step_of: Callable[[FloatArray], float], least: float) -> dict[str, float]:
    """Names of the plates whose wrenches (j, 6) under load come in larger steps than this, and the steps."""
    wrenches = zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True)
    steps = {name: step_of(wrench[wrench[:, 1] > FIRM_LOAD_N]) for name, wrench in wrenches}
    return {name: step for name, step in steps.items() if step > least}


def _coarsest_n(wrench: FloatArray) -> float:
    """The coarsest step of the forces along three axes."""
    return max(force_step_n(values) for values in wrench[:, :3].T)


def _coarsest_m(wrench: FloatArray) -> float:
    """The coarser step of the centre of pressure along X and Z."""
    point = centre_of_pressure(wrench)
    return max(_step(point[:, axis], _DECIMALS_M) for axis in (0, 2))


def _step(values: FloatArray, decimals: int) -> float:
    distinct = np.unique(np.round(values, decimals))
    if len(values) < _FEWEST_SAMPLES or len(distinct) < _FEWEST_VALUES:
        return 0.0
    step = float(np.diff(distinct).min())
    steps = (distinct - distinct[0]) / step
    return step if np.abs(steps - np.round(steps)).max() < _OFF_STEP else 0.0


def _pulled_s(beside: FloatArray, peak: float, step: float) -> float:
    """How long values (k,) beside a load, from it outwards, are below zero; 0 where they stay so."""
    pulled = runs(beside < -_PULLED_SHARE * peak)
    if not pulled or pulled[0][0] * step > _BESIDE_S or pulled[0][1] == len(beside) - 1:
        return 0.0
    lasts_s = (pulled[0][1] - pulled[0][0] + 1) * step
    return lasts_s if lasts_s < _LONGEST_S else 0.0


def _loads(loaded: BoolArray, bridged: float) -> list[tuple[int, int]]:
    """Runs of loaded samples, those with fewer samples between them as one."""
    joined: list[tuple[int, int]] = []
    for first, last in runs(loaded):
        if joined and first - joined[-1][1] < bridged:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined
