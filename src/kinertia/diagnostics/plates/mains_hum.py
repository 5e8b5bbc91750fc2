"""The hum of the mains in the forces: a cable without shield, a ground loop.

On 26 recordings of nine laboratories the forces have 0.9 N at most at 50 or 60 Hz, and there at most 3.4 times as much
as 10 to 16 Hz beside them (0.2 N at least are counted): impacts have all frequencies alike.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.sampled_time import runs

_MAINS_HZ = (50.0, 60.0)
_BESIDE_HZ = (-16.0, -13.0, -10.0, 10.0, 13.0, 16.0)
_HUM_N, _BESIDE_N, _STANDS_OUT = 4.0, 0.2, 6.0
_LOUD_N = 15.0
"""So much crosses the threshold of a load, where it begins and ends, several times."""
_SHORTEST_S, _SAMPLES_PER_PERIOD, _SLOW_ORDER = 0.2, 3.0, 6


def hum_trouble(plates: PlateLoads) -> str:
    """A hum so loud that loads seem to begin and end; empty where there is none."""
    return _sentence(plates, _LOUD_N)


def hum_doubts(plates: PlateLoads) -> list[str]:
    """A hum that is heard, if `hum_trouble` found none."""
    heard = _sentence(plates, _HUM_N)
    return [heard] if heard else []


def _sentence(plates: PlateLoads, least_n: float) -> str:
    loudest: tuple[float, str] = (0.0, "")
    for p, name in enumerate(plates.names):
        stretch = _longest_load(plates, p)
        if stretch is None:
            continue
        for mains_hz in _MAINS_HZ:
            frequencies = mains_hz + np.array([0.0, *_BESIDE_HZ])
            hum, *beside = _amplitudes(plates.time[stretch], plates.force[stretch, p], frequencies)
            stands_out = hum > _STANDS_OUT * np.max([*beside, np.full(3, _BESIDE_N)], axis=0)
            for axis in np.flatnonzero(stands_out):
                loudest = max(loudest, (float(hum[axis]), f"{mains_hz:g} Hz ({name}, along {'XYZ'[axis]})"))
    hum_n, where = loudest
    if not hum_n > least_n:
        return ""
    return (
        f"the forces hum with {hum_n:.0f} N at {where}: the mains, which a cable or amplifier picks up; find the "
        "ground loop or the bare cable, or take that frequency out (a notch filter that does not delay) before export"
    )


def _longest_load(plates: PlateLoads, p: int) -> slice | None:
    """The rows of the longest load of a plate; None where it is short or slowly sampled."""
    if len(plates.time) < 2:
        return None
    rate_hz = 1.0 / float(np.median(np.diff(plates.time)))
    loads = runs(plates.force[:, p, 1] > FIRM_LOAD_N)
    if not loads or rate_hz < _SAMPLES_PER_PERIOD * max(_MAINS_HZ):
        return None
    first, last = max(loads, key=lambda one: one[1] - one[0])
    return slice(first, last + 1) if (last - first) / rate_hz >= _SHORTEST_S else None


def _amplitudes(time: FloatArray, forces: FloatArray, frequencies_hz: FloatArray) -> FloatArray:
    """(f, 3) N, of these frequencies in forces (k, 3), less what changes slowly."""
    after = 2.0 * (time - time.mean()) / float(np.ptp(time))
    slow = np.polynomial.chebyshev.chebvander(after, _SLOW_ORDER)
    rest = forces - slow @ np.linalg.lstsq(slow, forces, rcond=None)[0]
    weight = np.hanning(len(time))
    turning = np.exp(-2j * np.pi * np.outer(frequencies_hz, time))
    result: FloatArray = 2.0 * np.abs(turning @ (weight[:, None] * rest)) / weight.sum()
    return result
