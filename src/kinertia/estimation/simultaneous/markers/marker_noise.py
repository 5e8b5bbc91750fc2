"""Estimates marker noise: standard deviations, and how errors are correlated over frames, markers and strides.

Skin motion lasts for many frames. Its standard deviation and correlation length are estimated from the residuals of
inverse kinematics, without their part that follows the joints (`skin`). The standard deviation is inflated by the
square root of the number of markers with common errors: those of a segment move with the same skin. Inverse kinematics
absorbs part of the noise, and so does the regression on the joints; this is compensated by degrees of freedom, only on
average.

Skin motion follows the joints: it is the same in every stride, and in the next walk. Errors that recur do not average
out, nor do the errors of a rigid model, which recur with the same strides. Their information counts only once: the
standard deviations of markers and forces are multiplied by the square root of the number of repeats.

Whether errors recur is determined from their correlation, summed over all marker coordinates; a repeat counts in
proportion to its correlation. The errors of two walks agree only at the same phase, so the best lag is searched for.
The cameras' noise never recurs, but averages out in a few frames: repeats are relative to what one frame shares with
the next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from scipy.fft import next_fast_len, rfft

from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.model.skeleton import Skeleton
from kinertia.motion.workload import pieces

SMALLEST_MARKER_SD_M = 0.001
_WANDERING = 3.0
_MOST_TAKEN = 0.6
"""Largest share of the errors' variance that regression on the joints is assumed to remove by chance."""
_ROUNDS = 2
"""Number of regressions: each weights the prior with the standard deviation of the residuals of the one before."""
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
    alike = [_resampled(trial_errors, rate / slowest) for trial_errors, rate in zip(errors, rates_hz, strict=True)]
    repetitions = [Repetition.of(resampled) for resampled in alike]
    counts = np.diag([repetition.strides for repetition in repetitions])
    for a, b in np.argwhere(~np.eye(len(repetitions), dtype=bool)):
        first, second = repetitions[a].period, repetitions[b].period
        other = alike[b] if first is None or second is None else _resampled(alike[b], second / first)
        slow = float(np.sqrt(repetitions[a].slow * repetitions[b].slow))
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


@dataclass(frozen=True)
class MarkerNoise:
    """Errors of the markers in one trial.

    Attributes:
        sd_m: per label, standard deviation of one coordinate in one frame, m, without the part that follows the joints.
        correlation_s: time over which errors are correlated.
        drifting: labels whose standard deviation is more than three times the usual; they drift and are down-weighted.
        repeats: number of strides in all trials together in which errors recur (`marker_noise`); 1: never.
        displacement_sd_m: per label, standard deviation of its displacement in this trial (`displacement`), m; 0 for
            one trial.
    """

    sd_m: Mapping[str, float]
    correlation_s: float
    drifting: tuple[str, ...]
    repeats: float = 1.0
    displacement_sd_m: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class WithoutSkin:
    """Errors of the markers in each of several trials, without their part that follows the joints.

    Attributes:
        varying: per trial (n, m, 3) m; NaN where not seen.
        displaced: (t, m, 3) m, mean offsets of the markers from their positions in the segments in each trial, without
            the effect of its postures.
    """

    varying: tuple[np.ndarray, ...]
    displaced: np.ndarray

    @classmethod
    def of(
        cls, varying: Sequence[np.ndarray], displaced: np.ndarray, skin: Sequence[SkinPatterns], frames: Sequence[float]
    ) -> Self:
        """Fit the skin patterns by ridge regression on all trials together, and subtract them.

        Args:
            varying: per trial (n, m, 3) m, errors in the axes of each marker's segment, of zero mean.
            displaced: (t, m, 3) m, means that were subtracted from them.
            skin: patterns of each trial.
            frames: per trial, number of frames over which its errors are correlated: so many count as one.
        """
        rests, still = [trial_errors.copy() for trial_errors in varying], displaced.copy()
        for m, (first, last) in enumerate(zip(skin[0].first, skin[0].last, strict=True)):
            seen = [np.isfinite(trial_errors[:, m]).all(axis=1) for trial_errors in varying]
            if last == first or not any(map(np.any, seen)):
                continue
            here = [patterns.values[shown, first:last] for patterns, shown in zip(skin, seen, strict=True)]
            middle = np.array(
                [shown_values.mean(axis=0) if len(shown_values) else np.zeros(last - first) for shown_values in here]
            )
            x = np.concatenate([(part - mean) / np.sqrt(f) for part, mean, f in zip(here, middle, frames, strict=True)])
            y = np.concatenate([e[shown, m] / np.sqrt(f) for e, shown, f in zip(varying, seen, frames, strict=True)])
            weight = np.concatenate([np.full(shown.sum(), f) for shown, f in zip(seen, frames, strict=True)])[:, None]
            square, rhs, left = x.T @ x, x.T @ y, y
            for _ in range(_ROUNDS):
                variance = max(float((weight * np.square(left)).mean()), SMALLEST_MARKER_SD_M**2 / 10.0)
                slopes = np.linalg.solve(square + variance * np.eye(last - first), rhs)
                left = y - x @ slopes
            parts = np.split(left * np.sqrt(weight), np.cumsum([shown.sum() for shown in seen])[:-1])
            for rest, shown, part in zip(rests, seen, parts, strict=True):
                rest[shown, m] = part
            still[:, m] -= middle @ slopes
        return cls(tuple(rests), still)


def marker_noise(
    skeleton: Skeleton, errors: np.ndarray, taken: np.ndarray, rate_hz: float
) -> tuple[MarkerNoise, np.ndarray, float, np.ndarray]:
    """Estimate the noise of the markers of a trial.

    It also returns the effective standard deviations (m,), the number of neighbouring frames over which errors of these
    standard deviations are correlated, and their products (2, 3, 3) with those of the two frames before
    (`Observation`).

    Args:
        skeleton: with the trial's markers.
        errors: (n, m, 3) m, without skin motion that follows the joints.
        taken: (m,) share of each marker's variance that is missing in them by chance, since the regression fits noise.
        rate_hz: of the frames.
    """
    seen = np.isfinite(errors).all(axis=-1)
    per_frame = 3 * seen.sum() / np.count_nonzero(seen.any(axis=1))
    lost = np.sqrt(per_frame / max(per_frame - len(skeleton.coordinates), 1.0))
    sd = np.maximum(lost * root_mean_square(errors), SMALLEST_MARKER_SD_M)
    frames = correlated_frames(errors, sd)
    usual = float(np.median(sd))
    labels = [label for label, shown in zip(skeleton.labels, seen.any(axis=0), strict=True) if shown]
    deviations = dict(zip(skeleton.labels, map(float, sd), strict=True))
    noise = MarkerNoise(
        {label: deviations[label] for label in labels},
        frames / rate_hz,
        tuple(label for label in labels if deviations[label] > _WANDERING * usual),
    )
    effective = sd * np.sqrt(markers_in_common(skeleton, errors) / (1.0 - taken))
    return noise, effective, frames, lost**2 * _products(skeleton, errors, effective)


def taken_by_chance(frames_seen: np.ndarray, patterns: np.ndarray, frames: float) -> np.ndarray:
    """Return the share (m,) of the errors' variance that regression on so many patterns (m,) removes by chance alone.

    It applies to so many frames (m,) with errors that are correlated over `frames`.
    """
    result: np.ndarray = np.minimum(patterns * frames / np.maximum(frames_seen, 1.0), _MOST_TAKEN)
    return result


def root_mean_square(errors: np.ndarray) -> np.ndarray:
    """Return the root mean square (m,) of errors (n, m, 3); zero for markers that are never seen."""
    squares, counts = np.zeros((2, errors.shape[1]))
    for some in pieces(len(errors)):
        seen = np.isfinite(errors[some])
        squares += np.square(np.where(seen, errors[some], 0.0)).sum(axis=(0, 2))
        counts += seen.sum(axis=(0, 2))
    return np.sqrt(squares / np.maximum(counts, 1))


def correlated_frames(errors: np.ndarray, sd_m: np.ndarray | float) -> float:
    """Return over how many neighbouring frames errors (n, m, 3) of these standard deviations (m,) are correlated."""
    return Repetition.of(weighed(errors, sd_m)).frames


def _products(skeleton: Skeleton, errors: np.ndarray, sd_m: np.ndarray) -> np.ndarray:
    """Return mean products (2, 3, 3) of the errors (n, m, 3), over their SDs (m,), of a frame and of the two before it.

    The first are of each marker, the second of the errors that the markers of a segment have in common, counted as in
    `markers_in_common`.
    """
    result, count = np.zeros((2, 3, 3)), 0
    of_segments = _of_segments(skeleton)
    for some in pieces(len(errors) - 2):
        here = errors[some.start : some.stop + 2] / sd_m[:, None]
        three = np.stack([here[2:], here[1:-1], here[:-2]])
        shown = np.isfinite(three).all(axis=(0, 3))
        three[:, ~shown] = 0.0
        common = np.einsum("sm,tnmk->tnsk", of_segments, three, optimize=True)
        kinds = [triple.reshape(3, -1) for triple in (three, common)]
        result += [kind @ kind.T for kind in kinds]
        count += 3 * int(np.count_nonzero(shown))
    return result / max(count, 1)


def _of_segments(skeleton: Skeleton) -> np.ndarray:
    """Return the matrix (s, m) that is 1 where a marker is on a segment, for segments that have markers."""
    result: np.ndarray = (np.unique(skeleton.marker_segments)[:, None] == skeleton.marker_segments).astype(float)
    return result


def weighed(errors: np.ndarray, sd_m: np.ndarray | float) -> np.ndarray:
    """Return errors (n, 3 m) over their standard deviations, as in the estimate: no drifting marker may dominate."""
    scale_m = np.broadcast_to(sd_m, errors.shape[1])
    result = errors / np.where(scale_m > 0.0, scale_m, 1.0)[:, None]
    return np.nan_to_num(result, copy=False).reshape(len(errors), -1)


def markers_in_common(skeleton: Skeleton, errors: np.ndarray) -> np.ndarray:
    """Return how many markers (m,) of each marker's segment err in common, from errors (n, m, 3); 1 if independent.

    The variance of a sum of k equal errors is k times that of k independent ones. NaN (not seen) counts as no error.
    """
    of_segments = _of_segments(skeleton)
    together, apart = np.zeros((2, len(of_segments)))
    for some in pieces(len(errors)):
        here = np.nan_to_num(errors[some])
        together += np.square(np.einsum("sm,nmk->nsk", of_segments, here, optimize=True)).sum(axis=(0, 2))
        apart += of_segments @ np.square(here).sum(axis=(0, 2))
    ratio = np.where(apart > 0.0, np.maximum(1.0, together / np.where(apart > 0.0, apart, 1.0)), 1.0)
    result: np.ndarray = ratio @ of_segments
    return result
