"""Computes root mean squares of values and of vector lengths, ignoring NaN."""

from __future__ import annotations

import numpy as np


def rms(values: np.ndarray) -> float:
    """Return the root mean square over everything that is not NaN."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def rms_length(vectors: np.ndarray) -> float:
    """Return the root mean square length of vectors (..., k) over everything that is not NaN."""
    return float(np.sqrt(np.nanmean(np.square(vectors).sum(axis=-1))))
