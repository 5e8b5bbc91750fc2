"""Computes root mean squares of values and of lengths of vectors; NaN does not count."""

from __future__ import annotations

import numpy as np


def rms(values: np.ndarray) -> float:
    """Root mean square over everything that is not NaN."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def rms_length(vectors: np.ndarray) -> float:
    """Root mean square length of vectors (..., k) over everything that is not NaN."""
    return float(np.sqrt(np.nanmean(np.square(vectors).sum(axis=-1))))
