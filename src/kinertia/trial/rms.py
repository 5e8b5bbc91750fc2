"""Computes root mean squares of values and of vector lengths, ignoring NaN; NaN of nothing else."""

import numpy as np


def rms(values: np.ndarray) -> float:
    """Return the root mean square over everything that is not NaN."""
    return _root_mean(np.square(values))


def rms_length(vectors: np.ndarray) -> float:
    """Return the root mean square length of vectors (..., k) over everything that is not NaN."""
    return _root_mean(np.square(vectors).sum(axis=-1))


def _root_mean(squares: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else float("nan")


def rms_by_marker(errors_m: np.ndarray) -> np.ndarray:
    """Return the RMS (m,) of distances (w, m) over the frames that show the marker; NaN for one never visible."""
    seen = np.isfinite(errors_m)
    total = np.square(np.where(seen, errors_m, 0.0)).sum(axis=0)
    with np.errstate(invalid="ignore"):
        result: np.ndarray = np.sqrt(total / seen.sum(axis=0))
        return result
