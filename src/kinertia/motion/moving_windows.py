"""Computes moving averages and extremes along the first axis.

They equal those of `scipy.ndimage`, with the same order of additions: importing it takes as long as importing NumPy,
and only these few functions are needed.
"""

import numpy as np

from kinertia.trial.data import BoolArray, FloatArray

_DEVIATIONS = 4.0
"""Standard deviations to either side at which a Gaussian weight ends."""


def gaussian_mean(values: FloatArray, deviation: float) -> FloatArray:
    """Compute the mean of values (n, ...) weighted by a Gaussian of this SD (samples); the ends are continued.

    Examples:
        >>> gaussian_mean(np.array([0.0, 0.0, 1.0, 0.0, 0.0]), 0.5).round(3).tolist()
        [0.0, 0.106, 0.787, 0.106, 0.0]
    """
    radius = int(_DEVIATIONS * deviation + 0.5)
    weights = np.exp(-0.5 / (deviation * deviation) * np.arange(-radius, radius + 1) ** 2)
    weights /= weights.sum()
    around, count = _with_ends(values, radius), len(values)
    result: FloatArray = around[radius : radius + count] * weights[radius]
    for k in range(radius):
        result += (around[k : k + count] + around[2 * radius - k : 2 * radius - k + count]) * weights[k]
    return result


def even_mean(values: FloatArray, size: int) -> FloatArray:
    """Compute the mean of values (n, ...) over an odd number of samples; the ends are continued.

    Examples:
        >>> even_mean(np.array([0.0, 0.0, 3.0, 0.0, 0.0]), 3).tolist()
        [0.0, 1.0, 1.0, 1.0, 0.0]
    """
    around = _with_ends(values, size // 2)
    steps = np.concatenate([np.cumsum(around[:size], axis=0)[-1:], around[size:] - around[:-size]])
    return np.cumsum(steps, axis=0) / size


def greatest(values: FloatArray, size: int) -> FloatArray:
    """Compute the maximum of values (n, ...) over an odd number of samples.

    Examples:
        >>> greatest(np.array([0.0, 0.0, 3.0, 0.0, 1.0]), 3).tolist()
        [0.0, 3.0, 3.0, 3.0, 1.0]
    """
    around = np.lib.stride_tricks.sliding_window_view(_with_ends(values, size // 2), size, axis=0)
    result: FloatArray = around.max(axis=-1)
    return result


def all_around(known: BoolArray, size: int) -> BoolArray:
    """Return whether (n, ...) all of an odd number of samples are True; beyond the ends all are False.

    Examples:
        >>> all_around(np.array([True, True, True, True, False, True]), 3).tolist()
        [False, True, True, False, False, False]
    """
    beyond = np.ones((size // 2, *known.shape[1:]), dtype=bool)
    none = np.zeros((1, *known.shape[1:]), dtype=bool)
    unknown = np.cumsum(np.concatenate([none, beyond, ~known, beyond]), axis=0)
    result: BoolArray = unknown[size:] == unknown[:-size]
    return result


def _with_ends(values: FloatArray, count: int) -> FloatArray:
    return np.concatenate([np.repeat(values[:1], count, axis=0), values, np.repeat(values[-1:], count, axis=0)])
