"""How often the marker errors of trials come back: with every stride, and in the other trials of the person.

Skin motion goes with the joints: it is the same in every stride, and in the next walk. Errors that come back do not
average out. Neither do those of a rigid model, which go with the same strides. What so many strides and trials say
counts once: the deviations of markers and forces are raised by the root of the number of repeats.

Whether errors come back is read from their correlation, summed over all marker coordinates; a repeat counts as much as
it is alike. A gait's errors are those of another only at the same phase, so the best lag is looked for. The cameras'
noise never comes back, but averages out in a few frames: repeats are over what one frame shares with the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_UNLIKE, _REPEATING = 0.05, 0.3
"""Correlations below which errors count as unlike, and above which they count as coming back."""
_AS_ALIKE = 0.9
"""Share of the largest correlation that marks the lags at which errors come back first."""
_SHORTEST_OWN, _SHORTEST_OTHER = 1.0 / 3.0, 1.0 / 2.0
"""Share of a trial that must overlap with itself, and of the shorter of two with the other: less would be alike by
chance, or because two trials cut from one have frames in common.
"""


@dataclass(frozen=True)
class Repetition:
    """Of the errors of one trial with themselves.

    Attributes:
        frames: over how many neighbouring frames they are alike; 1 for white noise.
        period: frames from one stride to the next; None where errors do not come back.
        strides: in how many strides they are alike; 1 where they do not come back.
        slow: share of their variance that one frame shares with the next.
    """

    frames: float
    period: int | None
    strides: float
    slow: float

    @classmethod
    def of(cls, errors: np.ndarray) -> Repetition:
        """Of errors (n, k), zero where a marker is not seen."""
        n = len(errors)
        alike, overlap = _correlation(errors, errors)
        alike, overlap = alike[n - 1 :], overlap[n - 1 :]
        if not alike[0] > 0:
            return cls(1.0, None, 1.0, 0.0)
        apart = int(np.argmax(alike < _UNLIKE)) or n
        frames = 1.0 + 2.0 * float(alike[1 : min(apart, n // 2)].sum())
        slow = max(float(alike[1]) * n / (n - 1), 0.0) if n > 1 else 0.0
        later = np.arange(apart, n)
        later = later[overlap[later] >= _SHORTEST_OWN * n]
        peak = _first_peak(alike[later] * n / overlap[later], apart)
        if peak is None:
            return cls(frames, None, 1.0, slow)
        period = int(later[peak])
        back = np.maximum(alike[period::period], 0.0) / slow
        return cls(frames, period, 1.0 + 2.0 * float(back.sum()), slow)


def repeats(errors: Sequence[np.ndarray], rates_hz: Sequence[float]) -> np.ndarray:
    """(t, t) how often the errors of each trial (rows) come back in each (columns): its strides on the diagonal, zero
    for trials that err in other ways. Sums over trials that are used together are what their information counts for.

    Args:
        errors: per trial (n, k) of the same columns, zero where a marker is not seen.
        rates_hz: per trial.
    """
    slowest = min(rates_hz)
    alike = [
        each[np.round(np.arange(int((len(each) - 1) * slowest / rate) + 1) * rate / slowest).astype(int)]
        for each, rate in zip(errors, rates_hz, strict=True)
    ]
    own = [Repetition.of(each) for each in alike]
    found = np.diag([each.strides for each in own])
    for a, b in np.argwhere(~np.eye(len(own), dtype=bool)):
        times = _in_other(alike[a], alike[b], own[a].period or own[b].period)
        found[a, b] = times / np.sqrt(own[a].slow * own[b].slow) if times else 0.0
    return found


def _in_other(errors: np.ndarray, other: np.ndarray, period: int | None) -> float:
    """How often errors (n, k) come back in those of another trial (m, k)."""
    alike, overlap = _correlation(errors, other)
    if not alike.any():
        return 0.0
    shortest = min(len(errors), len(other))
    lags = np.flatnonzero(overlap >= _SHORTEST_OTHER * shortest)
    peak = _first_peak(alike[lags] * len(errors) / overlap[lags], period or shortest)
    if peak is None:
        return 0.0
    first = int(lags[peak])
    every = np.arange(first % period, len(alike), period) if period else np.array([first])
    return float(np.maximum(alike[every], 0.0).sum())


def _first_peak(alike: np.ndarray, wide: int) -> int | None:
    """Index of the first of the largest peaks (what comes back after a stride does so after two); None if too low."""
    if not alike.size or alike.max() < _REPEATING:
        return None
    high = np.flatnonzero(alike > _AS_ALIKE * alike.max())
    high = high[high < high[0] + wide]
    return int(high[np.argmax(alike[high])])


def _correlation(errors: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlation of errors (n, k) with other (m, k) at lags -(n - 1) ... m - 1: the sum over common frames, over what
    n frames would give if the two were alike; and how many frames are common.
    """
    n, m = len(errors), len(other)
    power = np.sqrt(np.square(errors).mean() * np.square(other).mean()) * n * errors.shape[1]
    size = n + m - 1
    spectrum = (np.fft.rfft(errors, size, axis=0).conj() * np.fft.rfft(other, size, axis=0)).sum(axis=1)
    alike = np.roll(np.fft.irfft(spectrum, size), n - 1)
    lags = np.arange(1 - n, m)
    overlap = np.minimum(n, m - lags) - np.maximum(0, -lags)
    return alike / power if power > 0 else np.zeros(size), overlap
