"""Finds mains interference in the forces: a cable without shield, a ground loop.

On 26 recordings of nine laboratories the forces have at most 0.9 N at 50 or 60 Hz, at most 3.4 times as much as 10 to
16 Hz away (taken as 0.2 N at least): impacts contain all frequencies equally.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.sampled_time import runs

_MAINS_HZ = (50.0, 60.0)
_BESIDE_HZ = (-16.0, -13.0, -10.0, 10.0, 13.0, 16.0)
_HUM_N, _BESIDE_N, _STANDS_OUT = 4.0, 0.2, 6.0
_LOUD_N, _FILTERED = 15.0, 2.0
"""This amplitude crosses the load threshold several times at contact and off, unless the unloaded plate shows it:
then its noise sets the threshold, and forces are low-passed. In a measured walk, 20 and 71 N at 50 Hz then change leg
moments by 1 to 1.4 SD (RMS), and by up to 29 N m at foot contact."""
_SHORTEST_S, _SAMPLES_PER_PERIOD, _SLOW_ORDER = 0.2, 3.0, 6


def mains_interference(context: RecordingContext) -> Iterator[Finding]:
    """Report P107: mains interference of every plate and axis, at the stronger of the two mains frequencies."""
    plates = context.plates
    if plates is None:
        return
    noises_n = plates.noise_n or (0.0,) * len(plates.names)
    for p, name in enumerate(plates.names):
        rows = _longest_load(plates, p)
        if rows is None:
            continue
        hums = np.array([_hum_n(plates.time[rows], plates.force[rows, p], mains_hz) for mains_hz in _MAINS_HZ])
        for axis, (amplitude_n, mains_hz) in enumerate(zip(hums.max(axis=0), hums.argmax(axis=0), strict=True)):
            if amplitude_n > _HUM_N:
                yield finding(
                    "P107",
                    context.at(plate=name, **context.along(axis)),
                    Severity.ERROR if amplitude_n > max(_LOUD_N, _FILTERED * noises_n[p]) else None,
                    amplitude_n=Quantity(float(amplitude_n), "N", limit=_HUM_N, usual=(0.0, 0.9)),
                    frequency_hz=Quantity(_MAINS_HZ[mains_hz], "Hz"),
                )


def _longest_load(plates: PlateLoads, p: int) -> slice | None:
    """Return the rows of the longest load of a plate; None where it is short or slowly sampled."""
    if len(plates.time) < 2:
        return None
    rate_hz = 1.0 / float(np.median(np.diff(plates.time)))
    loads = runs(plates.force[:, p, 1] > FIRM_LOAD_N)
    if not loads or rate_hz < _SAMPLES_PER_PERIOD * max(_MAINS_HZ):
        return None
    first, last = max(loads, key=lambda one: one[1] - one[0])
    return slice(first, last + 1) if (last - first) / rate_hz >= _SHORTEST_S else None


def _hum_n(time: FloatArray, force: FloatArray, mains_hz: float) -> FloatArray:
    """Return the amplitude (3,) N at this frequency in a force (k, 3); 0 along axes where neighbours are as strong."""
    hum, *beside = _amplitudes(time, force, mains_hz + np.array([0.0, *_BESIDE_HZ]))
    stands_out = hum > _STANDS_OUT * np.max([*beside, np.full(3, _BESIDE_N)], axis=0)
    return np.where(stands_out, hum, 0.0)


def _amplitudes(time: FloatArray, forces: FloatArray, frequencies_hz: FloatArray) -> FloatArray:
    """Return amplitudes (f, 3) N at these frequencies in forces (k, 3), less slow changes."""
    after = 2.0 * (time - time.mean()) / float(np.ptp(time))
    slow = np.polynomial.chebyshev.chebvander(after, _SLOW_ORDER)
    rest = forces - slow @ np.linalg.lstsq(slow, forces, rcond=None)[0]
    weight = np.hanning(len(time))
    turning = np.exp(-2j * np.pi * np.outer(frequencies_hz, time))
    result: FloatArray = 2.0 * np.abs(turning @ (weight[:, None] * rest)) / weight.sum()
    return result
