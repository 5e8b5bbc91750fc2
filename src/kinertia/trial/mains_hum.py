"""The hum of the mains in the forces: a cable without shield, a ground loop.

On 26 recordings of nine laboratories the forces have 0.9 N at most at 50 or 60 Hz, and there at most 3.4 times as much
as 10 to 16 Hz beside them (0.2 N at least are counted): impacts have all frequencies alike.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads, runs

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
        for axis in range(3) if stretch is not None else ():
            values, time = plates.force[stretch, p, axis], plates.time[stretch]
            for mains_hz in _MAINS_HZ:
                hum = _amplitude(time, values, mains_hz)
                beside = max(_amplitude(time, values, mains_hz + off) for off in _BESIDE_HZ)
                if hum > _STANDS_OUT * max(beside, _BESIDE_N):
                    loudest = max(loudest, (hum, f"{mains_hz:g} Hz ({name}, along {'XYZ'[axis]})"))
    hum, where = loudest
    if not hum > least_n:
        return ""
    return (
        f"the forces hum with {hum:.0f} N at {where}: the mains, which a cable or amplifier picks up; find the "
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


def _amplitude(time: FloatArray, values: FloatArray, frequency_hz: float) -> float:
    """Of one frequency, less what changes slowly."""
    after = 2.0 * (time - time.mean()) / float(np.ptp(time))
    rest = values - np.polynomial.Polynomial.fit(after, values, _SLOW_ORDER)(after)
    weight = np.hanning(len(values))
    turning = np.exp(-2j * np.pi * frequency_hz * time)
    return 2.0 * float(np.abs((rest * weight * turning).sum()) / weight.sum())
