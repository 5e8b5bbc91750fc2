"""Searches sample times, finds contiguous runs, and computes root mean squares that ignore NaN.

Rounding errors of the times do not change results.
"""

import numpy as np
import numpy.typing as npt

TIME_TOLERANCE_S = 1e-6
"""Times that differ by less are equal, so that rounding errors change no result."""


def nearest_samples(time: npt.NDArray[np.float64], at: npt.NDArray[np.float64]) -> npt.NDArray[np.int_]:
    """Return indices into `time` (ascending) of the samples nearest to `at`; of two equally near, the later one."""
    after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
    return after - (at - time[after - 1] < time[after] - at - TIME_TOLERANCE_S)


def within(time: npt.NDArray[np.float64], start_s: float, end_s: float) -> npt.NDArray[np.bool_]:
    """Return the mask of times from start_s to end_s, both included, despite rounding errors."""
    return (time >= start_s - TIME_TOLERANCE_S) & (time <= end_s + TIME_TOLERANCE_S)


def span_s(time: npt.NDArray[np.float64], first: int = 0, last: int = -1) -> float:
    """Return the seconds from one sample to another, rounded to a microsecond: exactly 0.04 for 10.17 to 10.21 s."""
    return round(float(time[last] - time[first]), 6)


def runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last index of every contiguous run of True, in order."""
    padded = np.concatenate(([False], mask, [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1])
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


def windows(time: npt.NDArray[np.float64], mask: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return first and last time (s) of every contiguous run of True in `mask` (n,), longest run first."""
    spans = [(float(time[first]), float(time[last])) for first, last in runs(mask)]
    return sorted(spans, key=lambda span: span[0] - span[1])


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
