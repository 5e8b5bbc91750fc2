"""Estimates marker noise: standard deviations, and over how many frames and markers errors are correlated.

Skin motion lasts for many frames. Its standard deviation and correlation length are estimated from the residuals of
inverse kinematics, without their part that follows the joints (`skin`). The standard deviation is inflated by the
square root of the number of markers with common errors: those of a segment move with the same skin. Inverse kinematics
absorbs part of the noise, and so does the regression on the joints; this is compensated by degrees of freedom, only on
average.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.markers.error_repetition import Repetition
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns
from kinertia.model.skeleton import Skeleton
from kinertia.motion.workload import pieces

SMALLEST_MARKER_SD_M = 0.001
_WANDERING = 3.0
_MOST_TAKEN = 0.6
"""Largest share of the errors' variance that regression on the joints is assumed to remove by chance."""
_ROUNDS = 2
"""Number of regressions: each weights the prior with the standard deviation of the residuals of the one before."""


@dataclass(frozen=True)
class MarkerNoise:
    """Errors of the markers in one trial.

    Attributes:
        sd_m: per label, standard deviation of one coordinate in one frame, m, without the part that follows the joints.
        correlation_s: time over which errors are correlated.
        drifting: labels whose standard deviation is more than three times the usual; they drift and are down-weighted.
        repeats: number of strides in all trials together in which errors recur (`error_repetition`); 1: never.
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
        rests, still = [each.copy() for each in varying], displaced.copy()
        for m, (first, last) in enumerate(zip(skin[0].first, skin[0].last, strict=True)):
            seen = [np.isfinite(each[:, m]).all(axis=1) for each in varying]
            if last == first or not any(map(np.any, seen)):
                continue
            here = [each.values[shown, first:last] for each, shown in zip(skin, seen, strict=True)]
            middle = np.array([each.mean(axis=0) if len(each) else np.zeros(last - first) for each in here])
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
        kinds = [each.reshape(3, -1) for each in (three, common)]
        result += [each @ each.T for each in kinds]
        count += 3 * int(np.count_nonzero(shown))
    return result / max(count, 1)


def _of_segments(skeleton: Skeleton) -> np.ndarray:
    """Return the matrix (s, m) that is 1 where a marker is on a segment, for segments that have markers."""
    result: np.ndarray = (np.unique(skeleton.marker_segments)[:, None] == skeleton.marker_segments).astype(float)
    return result


def weighed(errors: np.ndarray, sd_m: np.ndarray | float) -> np.ndarray:
    """Return errors (n, 3 m) over their standard deviations, as in the estimate: no drifting marker may dominate."""
    each = np.broadcast_to(sd_m, errors.shape[1])
    result = errors / np.where(each > 0.0, each, 1.0)[:, None]
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
    each = np.where(apart > 0.0, np.maximum(1.0, together / np.where(apart > 0.0, apart, 1.0)), 1.0)
    result: np.ndarray = each @ of_segments
    return result
