"""Which strides a mean curve is of: the same all along, since a mean of changing strides has steps that nobody made."""

from __future__ import annotations

import numpy as np

_AS_LONG = 0.9
"""Of the longest curve: more strides are worth so much of the cycle."""


def common_strides(values: np.ndarray) -> np.ndarray:
    """Tell which of the curves (n, 101), NaN where they were not measured, to average: (n,) bool.

    Complete ones where there are any. Else those that together were measured longest, counted in frames of all of them,
    in at least nine tenths of what the longest alone covers.

    >>> common_strides(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [True, False, True]
    """
    known = np.isfinite(values)
    length = known.sum(axis=1)
    chosen: np.ndarray = known.all(axis=1)
    if chosen.any() or not length.any():
        return chosen
    order = np.argsort(-length, kind="stable")
    together = np.logical_and.accumulate(known[order], axis=0).sum(axis=1)
    worth = np.where(together >= _AS_LONG * length.max(), together * np.arange(1, len(values) + 1), 0)
    chosen[order[: int(np.argmax(worth)) + 1]] = True
    return chosen


def mean_of(values: np.ndarray) -> np.ndarray:
    """(101,) mean of curves (n, 101), NaN where one of them was not measured; NaN everywhere of none."""
    result: np.ndarray = values.mean(axis=0) if len(values) else np.full(values.shape[1], np.nan)
    return result


def mean_of_common(values: np.ndarray) -> np.ndarray:
    """(101,) mean of the curves (n, 101) that `common_strides` chooses.

    >>> mean_of_common(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [2.0, 2.0, 2.0]
    """
    return mean_of(values[common_strides(values)])
