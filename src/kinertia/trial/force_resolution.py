"""Measures how long forces overshoot next to a load, an effect of far too strong filtering.

On 26 recordings of nine laboratories no plate reads below zero for more than 3 ms next to a load.
"""

import numpy as np

from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray
from kinertia.trial.sampled_time import runs

_PULLED_SHARE, _BESIDE_S, _WITHIN_S, _LONGEST_S, _FEWEST_BESIDE_S = 0.005, 0.04, 0.3, 0.2, 0.15
"""Share of a load's peak; largest distance from the load at which it begins; search span; longest duration: a wrong
zero, or the load of another plate, lasts longer."""
_SHORTEST_LOAD_S, _LEAST_LOAD_N, _BRIDGED_S = 0.15, 200.0, 0.05


def ringing_s(time: FloatArray, vertical: FloatArray) -> float:
    """Return for how long (s) a plate reads below zero just before foot contact and just after foot off.

    It is 0 unless both happen. A foot cannot pull on a plate, but a zero-phase filter spreads a load in this way.

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


def _pulled_s(beside: FloatArray, peak: float, step: float) -> float:
    """Return how long (s) values (k,) beside a load, ordered outwards, are below zero; 0 if they stay there."""
    pulled = runs(beside < -_PULLED_SHARE * peak)
    if not pulled or pulled[0][0] * step > _BESIDE_S or pulled[0][1] == len(beside) - 1:
        return 0.0
    lasts_s = (pulled[0][1] - pulled[0][0] + 1) * step
    return lasts_s if lasts_s < _LONGEST_S else 0.0


def _loads(loaded: BoolArray, bridged: float) -> list[tuple[int, int]]:
    """Return the runs of loaded samples, merging runs with fewer than `bridged` samples between them."""
    joined: list[tuple[int, int]] = []
    for first, last in runs(loaded):
        if joined and first - joined[-1][1] < bridged:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined
