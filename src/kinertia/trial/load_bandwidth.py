"""Estimates the bandwidth of loads on force plates: a low-pass filter spreads each contact in time.

What a spline of 22 Hz leaves of the vertical force within a contact is 0.2 to 1.3 % of its peak (RMS) in 37 recordings
as plates gave them, and falls with the third power of the cutoff of a filter: 0.016 % after a zero-phase Butterworth
filter with its cutoff (-3 dB) at 10 Hz, within a factor of 2 in 80 % of recordings. So the cutoff is known within a
fifth or so. Less is left of somebody who lands softly.
"""

import numpy as np
from scipy.interpolate import make_lsq_spline

from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray
from kinertia.trial.sampled_data import runs

_SPLINE_HZ, _DEGREE = 22.0, 5
_USUAL_HZ, _USUAL_SHARE, _POWER = 10.0, 1.6e-4, 3.0
"""A filter with its cutoff at the first leaves the second."""
_SHORTEST_S, _LONGEST_S, _LEAST_PEAK_N = 0.2, 1.5, 200.0
_BESIDE_S, _TRIMMED_S = 0.05, 0.008
"""A contact counts if the recording extends this far beyond it; its ends, where a reader may have set small forces to
zero, do not."""
_SAMPLES_PER_COEFFICIENT = 1.25
_LEAST_HZ = 5.0
"""Less than this is somebody who lands softly, or filters one after another."""


def load_bandwidth_hz(time: FloatArray, vertical: FloatArray) -> float | None:
    """Return the cutoff (Hz) of the low-pass filter that the loads look filtered with, median over contacts.

    Loads that were not filtered give 20 Hz or more. None where there is no whole contact of a step, or too few samples.

    Args:
        time: (k,) s.
        vertical: (k, p) N, vertical forces of plates or feet.
    """
    shares = [share for column in vertical.T for share in _fast_shares(time, np.nan_to_num(column))]
    if not shares:
        return None
    return max(_LEAST_HZ, float(_USUAL_HZ * (np.median(shares) / _USUAL_SHARE) ** (1.0 / _POWER)))


def _fast_shares(time: FloatArray, vertical: FloatArray) -> list[float]:
    """Return what the spline leaves of each contact (RMS), as share of its peak."""
    found = []
    for first, last in runs(vertical > LOAD_THRESHOLD_N):
        start_s, end_s = float(time[first]), float(time[last])
        whole = start_s - time[0] > _BESIDE_S and time[-1] - end_s > _BESIDE_S
        rows = (time >= start_s + _TRIMMED_S) & (time <= end_s - _TRIMMED_S)
        load = vertical[rows]
        if not whole or not _SHORTEST_S < end_s - start_s < _LONGEST_S or load.max(initial=0.0) < _LEAST_PEAK_N:
            continue
        at = np.linspace(start_s + _TRIMMED_S, end_s - _TRIMMED_S, len(load))  # files round times
        inner = np.linspace(at[0], at[-1], max(round(2.0 * _SPLINE_HZ * float(at[-1] - at[0])), 1) + 1)
        knots = np.r_[[at[0]] * _DEGREE, inner, [at[-1]] * _DEGREE]
        if len(at) < _SAMPLES_PER_COEFFICIENT * (len(knots) - _DEGREE - 1):
            continue
        left = load - make_lsq_spline(at, load, knots, _DEGREE)(at)
        found.append(float(np.sqrt(np.square(left).mean()) / load.max()))
    return found
