"""Restores uniform sample times that were rounded when they were written."""

import contextlib
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import FloatArray
from kinertia.trial.impossible_data import step_evidence

_MOST_DECIMALS = 7
_COARSEST_S = 0.01
"""Times in coarser units hardly show where samples are missing."""
_OFF = 0.75
"""Largest distance of rounded times from even ones, in units: half a unit and the error of the straight line."""
_FEWEST_ODD, _ODD_SHARE = 5, 0.02
"""Rounding makes irregular steps all the time; a missing or repeated sample makes one."""
_FEWEST_BEFORE_LAST = 10
"""With fewer samples it is unknown which one is irregular."""
_LARGEST_STEP_S = 0.1
"""Plates are sampled at 50 Hz and more, also once they were reduced to the rate of slow cameras."""
_NOTICED = 0.05
"""Share of a step; times with smaller deviations stay unchanged."""


def rounding_s(time: FloatArray) -> float:
    """Return the unit of the last decimal of the times; 0 where there are too many decimals."""
    for decimals in range(_MOST_DECIMALS):
        if np.abs(time - time.round(decimals)).max() < 1e-9:
            return float(10.0**-decimals)
    return 0.0


def uniform_times(path: Path, time: FloatArray) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Return times (k,) s of forces unchanged, or on the even grid that they were rounded from, with findings.

    Only the times show the rate: the grid is the straight line through them (T102). At 2000 Hz and in whole
    milliseconds every other step is zero. If only the last time is irregular, its sample is left out (T105): then the
    times are k - 1.

    Raises:
        FileError: samples are missing or repeated, time goes back, or its unit is not the second.
    """
    try:
        return _even(path, time)
    except FileError:
        if len(time) < _FEWEST_BEFORE_LAST:
            raise
        with contextlib.suppress(FileError):
            kept, findings = _even(path, time[:-1])
            evidence = step_evidence(time[-2], time[-1], float(np.median(np.diff(time))))
            return kept, (with_evidence("T105", Where(path.name), evidence), *findings)
        raise


def _even(path: Path, time: FloatArray) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Return even times and findings, with the last time treated as all others."""
    steps = np.diff(time)
    if not steps.size:
        return time, ()
    usual = float(np.median(steps))
    if usual > _LARGEST_STEP_S:
        raise FileError.found(path, "T106", step_s=Quantity(usual, "s", limit=_LARGEST_STEP_S))
    odd = np.flatnonzero((steps <= 0) | (np.abs(steps - usual) > 0.5 * abs(usual)))
    unit = rounding_s(time)
    step, start = np.polyfit(np.arange(len(time)), time, 1)
    even = start + step * np.arange(len(time))
    error = float(np.abs(time - even).max())
    rounded = 0 < unit <= _COARSEST_S and step > 0 and error <= _OFF * unit
    often = odd.size >= _FEWEST_ODD and odd.size > _ODD_SHARE * steps.size
    if odd.size and not (rounded and often):
        raise uneven(path, None, time[odd[0]], time[odd[0] + 1], usual)
    if not rounded or error <= _NOTICED * step:
        return time, ()
    return even, (times_rounded(path, unit, 1 / step),)


def uneven(path: Path, line: int | None, before: float, after: float, usual: float) -> FileError:
    """Return the error for two times (s) whose step is irregular."""
    return FileError.found(path, "T101", line, **step_evidence(before, after, usual))


def times_rounded(path: Path, rounding: float, rate_hz: float) -> Finding:
    """Return T102: times were rounded by this many seconds and replaced by times at an even rate."""
    return finding(
        "T102", Where(path.name), rounding_s=Quantity(float(rounding), "s"), rate_hz=Quantity(float(rate_hz), "Hz")
    )
