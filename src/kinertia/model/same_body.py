"""Is the static trial one of the person who walks? Distances between markers of one segment say so."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

_LOWER = ("pelvis", *(f"{name}_{side}" for name in ("thigh", "shank", "foot") for side in "rl"))
_OTHER_BODY = 0.05
"""Median share by which the distances may differ; on sound trials it is at most 0.012."""
_FEWEST_PAIRS = 6


def body_trouble(static: Markers, trial: Markers, marker_set: MarkerSet) -> str:
    """Why static trial and trial cannot show the same person; empty where they may.

    Compared are markers of one segment of pelvis, legs and feet: medians over the frames. The upper body is left out,
    whose skin moves with the arms.
    """
    both = set(static.labels) & set(trial.labels)
    pairs = [
        pair
        for segment in _LOWER
        for pair in combinations([label for label in marker_set.segments.get(segment, ()) if label in both], 2)
    ]
    if not pairs:
        return ""
    before, after = (_distances(markers, pairs) for markers in (static, trial))
    known = (before > 0) & (after > 0)
    if known.sum() < _FEWEST_PAIRS:
        return ""
    ratio = float(np.median(after[known] / before[known]))
    if abs(ratio - 1) <= _OTHER_BODY:
        return ""
    worst = int(np.argmax(np.where(known, np.abs(after - before), 0.0)))
    word = "longer" if ratio > 1 else "shorter"
    return (
        f"the distances between markers of one segment are {100 * abs(ratio - 1):.0f} % {word} than in the static "
        f"trial (median of {known.sum()}; {pairs[worst][0]} to {pairs[worst][1]}: {1e3 * after[worst]:.0f} mm, there "
        f"{1e3 * before[worst]:.0f} mm); the static trial is of another person or in another unit: give the one of "
        f"this person and session"
    )


def _distances(markers: Markers, pairs: list[tuple[str, str]]) -> FloatArray:
    """(p,) m, NaN for a pair that is never seen together."""
    ends = (markers.arranged([pair[k] for pair in pairs]) for k in range(2))
    distances = np.linalg.norm(np.subtract(*ends), axis=-1)
    seen = np.isfinite(distances).any(axis=0)
    return np.where(seen, np.nanmedian(np.where(seen, distances, 0.0), axis=0), np.nan)
