"""Decides whether anyone moves in a recording, from the speed of the markers."""

import numpy as np

from kinertia.trial.data import Markers

STILL_M_S = 0.1
"""Speed limit of standing: markers move by a few cm/s in standing, by about 1 m/s in walking."""
_WITHIN_S = 0.1
_SHARE = 0.9


def speed_m_s(markers: Markers) -> float:
    """Return the median marker speed (m/s) over a tenth of a second, its 90th percentile over the frames.

    It is zero for a shorter recording, and infinite if no marker is visible that long.

    >>> still = np.ones((50, 2, 3))
    >>> speed_m_s(Markers(np.arange(50) / 100, ("A", "B"), still))
    0.0
    """
    positions, time = markers.positions, markers.time
    step = int(np.searchsorted(time - time[0], _WITHIN_S))
    if not 0 < step < len(time):
        return 0.0
    speed = np.linalg.norm(positions[step:] - positions[:-step], axis=2) / (time[step] - time[0])
    seen = speed[np.isfinite(speed).any(axis=1)]
    return float(np.quantile(np.nanmedian(seen, axis=1), _SHARE)) if len(seen) else float("inf")
