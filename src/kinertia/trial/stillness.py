"""Decides whether anyone moves in a recording, from the speed of the markers."""

import numpy as np

from kinertia.trial.data import FloatArray, Markers
from kinertia.trial.sampled_time import runs

STILL_M_S = 0.1
"""Speed limit of standing: markers move by a few cm/s in standing, by about 1 m/s in walking."""
_WITHIN_S = 0.1
_SHARE, _LEAST_STILL_S = 0.9, 0.5


def speed_m_s(markers: Markers) -> float:
    """Return the median marker speed (m/s) over a tenth of a second, its 90th percentile over the frames.

    It is zero for a shorter recording, and infinite if no marker is visible that long.

    >>> still = np.ones((50, 2, 3))
    >>> speed_m_s(Markers(np.arange(50) / 100, ("A", "B"), still))
    0.0
    """
    if not 0 < _step(markers) < len(markers.time):
        return 0.0
    speeds = _speeds(markers)
    seen = speeds[np.isfinite(speeds)]
    return float(np.quantile(seen, _SHARE)) if len(seen) else float("inf")


def still_span_s(markers: Markers) -> tuple[float, float] | None:
    """Return first and last time (s) of the longest part in which nobody moves; None if it is shorter than 0.5 s."""
    step = _step(markers)
    if not 0 < step < len(markers.time):
        return None
    still = runs(np.nan_to_num(_speeds(markers), nan=np.inf) < STILL_M_S)
    first, last = max(still, key=lambda run: run[1] - run[0], default=(0, 0))
    start, end = float(markers.time[first]), float(markers.time[last + step])
    return (start, end) if last > first and end - start >= _LEAST_STILL_S else None


def _step(markers: Markers) -> int:
    """Return the number of frames over which speeds are measured."""
    return int(np.searchsorted(markers.time - markers.time[0], _WITHIN_S))


def _speeds(markers: Markers) -> FloatArray:
    """Return the median speed (n - step,) m/s of the markers from each frame on; NaN where none is seen."""
    positions, time, step = markers.positions, markers.time, _step(markers)
    speed = np.linalg.norm(positions[step:] - positions[:-step], axis=2) / (time[step] - time[0])
    seen = np.isfinite(speed).any(axis=1)
    result = np.full(len(speed), np.nan)
    result[seen] = np.nanmedian(speed[seen], axis=1)
    return result
