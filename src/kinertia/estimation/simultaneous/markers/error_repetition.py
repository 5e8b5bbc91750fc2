"""Estimates how much of the marker errors repeats with every stride, and in the person's other trials.

Skin motion follows the joints: it is the same in every stride, and in the next walk. Errors that recur do not average
out, nor do the errors of a rigid model, which recur with the same strides. Their information counts only once: the
standard deviations of markers and forces are multiplied by the square root of the number of repeats.

Whether errors recur is determined from their correlation, summed over all marker coordinates; a repeat counts in
proportion to its correlation. The errors of two walks agree only at the same phase, so the best lag is searched for.
The cameras' noise never recurs, but averages out in a few frames: repeats are relative to what one frame shares with
the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.fft import next_fast_len, rfft

from kinertia.motion.workload import pieces

_UNLIKE, _REPEATING = 0.05, 0.3
"""Correlations below which errors count as uncorrelated, and above which they count as recurring."""
_AS_ALIKE = 0.9
"""Share of the largest correlation that marks the lags at which errors first recur."""
_SHORTEST_OWN, _SHORTEST_OTHER = 1.0 / 3.0, 1.0 / 2.0
"""Share of a trial that must overlap with itself, and of the shorter of two with the other: shorter overlaps would be
correlated by chance, or because two trials cut from one have frames in common.
"""
_WHITE = 0.1
"""Share of the variance that one frame shares with the next below which errors are the cameras' noise."""

_COLUMNS_AT_ONCE = 4
"""Number of columns transformed at once: spectra take four times the memory of their columns."""


@dataclass(frozen=True)
class Repetition:
    """Repetition of the errors within one trial.

    Attributes:
        frames: number of neighbouring frames over which they are correlated; 1 for white noise.
        period: frames from one stride to the next; None if errors do not recur.
        strides: number of strides in which they recur; 1 if they do not.
        slow: share of their variance that one frame shares with the next.
    """

    frames: float
    period: float | None
    strides: float
    slow: float

    @classmethod
    def of(cls, errors: np.ndarray) -> Self:
        """Analyse errors (n, k), zero where a marker is not seen."""
        n = len(errors)
        alike, overlap = (part[n - 1 :] for part in _correlation(errors, errors))
        if n < 2 or not alike[0] > 0:
            return cls(1.0, None, 1.0, 0.0)
        apart = int(np.argmax(alike < _UNLIKE)) or n
        frames = 1.0 + 2.0 * float(alike[1 : min(apart, n // 2)].sum())
        per_pair = alike * n / overlap
        slow = max(float(per_pair[1]), 0.0)
        later = np.arange(apart, n)
        later = later[overlap[later] >= _SHORTEST_OWN * n]
        peak = _first_peak(per_pair[later], apart)
        if peak is None or slow < _WHITE:
            return cls(frames, None, 1.0, slow)
        period = _refined(alike, int(later[peak]))
        every = np.round(np.arange(period, n - 0.5, period)).astype(int)
        back = _counted(per_pair[every] / slow, overlap[every] / n)
        return cls(frames, period, 1.0 + 2.0 * back, slow)


def repeats(errors: Sequence[np.ndarray], rates_hz: Sequence[float]) -> np.ndarray:
    """Count how often the errors of each trial (rows) recur in each (columns): returns (t, t).

    The diagonal holds the trial's own strides; trials with other errors have zero. The information of trials that are
    used together counts for its sum over them. If both trials have at least two strides, their pace may differ. Few
    markers, or errors of few kinds, may be correlated by chance; their information is then underestimated.

    Args:
        errors: per trial (n, k) of the same columns, zero where a marker is not seen.
        rates_hz: per trial.
    """
    slowest = min(rates_hz)
    alike = [_resampled(each, rate / slowest) for each, rate in zip(errors, rates_hz, strict=True)]
    own = [Repetition.of(each) for each in alike]
    counts = np.diag([each.strides for each in own])
    for a, b in np.argwhere(~np.eye(len(own), dtype=bool)):
        first, second = own[a].period, own[b].period
        other = alike[b] if first is None or second is None else _resampled(alike[b], second / first)
        slow = float(np.sqrt(own[a].slow * own[b].slow))
        counts[a, b] = _in_other(alike[a], other, first or second, slow)
    return counts


def _in_other(errors: np.ndarray, other: np.ndarray, period: float | None, slow: float) -> float:
    """Count how often errors (n, k) recur in those of another trial (m, k)."""
    n, shortest = len(errors), min(len(errors), len(other))
    alike, overlap = _correlation(errors, other)
    per_pair = alike * n / overlap
    lags = np.flatnonzero(overlap >= _SHORTEST_OTHER * shortest)
    peak = _first_peak(per_pair[lags], round(period or shortest))
    if peak is None or slow < _WHITE:
        return 0.0
    every = lags[peak : peak + 1]
    if period is not None:
        every = np.round(np.arange(every[0] % period, len(alike) - 0.5, period)).astype(int)
    return _counted(per_pair[every] / slow, overlap[every] / n)


def _counted(alike: np.ndarray, share: np.ndarray) -> float:
    """Return the number of repeats with these correlations, over these shares of the errors' frames."""
    return float((np.clip(alike, 0.0, 1.0) * share).sum())


def _resampled(errors: np.ndarray, step: float) -> np.ndarray:
    """Resample errors (n, k) at every `step` frames."""
    if step == 1.0:
        return errors
    at = np.arange(0.0, len(errors) - 1 + 1e-9, step)
    before = np.minimum(at.astype(int), len(errors) - 1)
    after = np.minimum(before + 1, len(errors) - 1)
    share = (at - before)[:, None]
    result: np.ndarray = (1.0 - share) * errors[before] + share * errors[after]
    return result


def _refined(alike: np.ndarray, period: int) -> float:
    """Refine the period from the last of its multiples that still shows a peak: a frame matters after ten strides."""
    refined, k = float(period), 2
    while round(refined * k) + 2 < len(alike) and alike[round(refined * k)] > 0:
        near = round(refined * k) + np.arange(-2, 3)
        refined = float(near[np.argmax(alike[near])]) / k
        k += 1
    return refined


def _first_peak(alike: np.ndarray, wide: int) -> int | None:
    """Return the index of the first of the largest peaks (they recur at multiples of a stride); None if too low."""
    if not alike.size or alike.max() < _REPEATING:
        return None
    high = np.flatnonzero(alike > _AS_ALIKE * alike.max())
    high = high[high < high[0] + wide]
    return int(high[np.argmax(alike[high])])


def _correlation(errors: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlate errors (n, k) with other errors (m, k) at lags -(n - 1) ... m - 1.

    Returned are the sum over common frames, relative to n frames of equal errors, and the number of common frames.
    """
    n, m = len(errors), len(other)
    power = np.sqrt(np.square(errors).mean() * np.square(other).mean()) * n * errors.shape[1]
    size = n + m - 1
    padded = next_fast_len(size, real=True)
    spectrum = np.zeros(padded // 2 + 1, dtype=complex)
    for some in pieces(errors.shape[1], _COLUMNS_AT_ONCE):
        ours = _spectra(errors[:, some], padded)
        theirs = ours if other is errors else _spectra(other[:, some], padded)
        spectrum += np.einsum("kf,kf->f", ours.conj(), theirs)
    alike = np.roll(np.fft.irfft(spectrum, padded), n - 1)[:size]
    lags = np.arange(1 - n, m)
    overlap = np.minimum(n, m - lags) - np.maximum(0, -lags)
    return alike / power if power > 0 else np.zeros(size), overlap


def _spectra(columns: np.ndarray, padded: int) -> np.ndarray:
    """Return the spectra (k, f) of columns (n, k), padded with zeros; contiguous rows take half the time."""
    result: np.ndarray = rfft(np.ascontiguousarray(columns.T), padded)
    return result
