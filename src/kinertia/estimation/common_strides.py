"""Selects the strides of a mean curve, the same over the whole cycle: a mean of changing strides has false steps."""

import numpy as np

_AS_LONG = 0.9
"""Least length of the common part, relative to the longest curve: so much of the cycle may be given up for more
strides."""


def common_strides(values: np.ndarray) -> np.ndarray:
    """Select the curves (n, 101), NaN where not measured, that are to be averaged: returns (n,) bool.

    Complete curves are used if there are any. Otherwise those are chosen that together have the most measured frames,
    provided that their common part covers at least nine tenths of the longest curve.

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
    """Return the mean (101,) of curves (n, 101): NaN where one was not measured, and throughout without curves."""
    return values.mean(axis=0) if len(values) else np.full(values.shape[1], np.nan)


def mean_of_common(values: np.ndarray) -> np.ndarray:
    """Return the mean (101,) of the curves (n, 101) that `common_strides` selects.

    >>> mean_of_common(np.array([[1.0, 2.0, 3.0], [4.0, np.nan, np.nan], [3.0, 2.0, 1.0]])).tolist()
    [2.0, 2.0, 2.0]
    """
    return mean_of(values[common_strides(values)])
