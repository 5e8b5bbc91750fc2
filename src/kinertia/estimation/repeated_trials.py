"""Is one recording listed as several trials? Counted twice, its errors look half as large as they are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from kinertia.trial.data import Recording

Span = tuple[float, float] | None


def repeated_trials(recordings: Sequence[Recording], windows: Sequence[Span]) -> list[str]:
    """Pairs of trials whose markers are the same to the last digit, over times that overlap.

    Args:
        recordings: of the trials.
        windows: what the user wants of each, if anything.
    """
    pairs = combinations(zip(recordings, windows, strict=True), 2)
    return [
        f"the trials '{first.name}' and '{other.name}' have the same markers to the last digit: one recording is "
        "listed twice, or its copy has another name; it counts twice, and error bars are too short: list it once, and "
        "give the file of the other trial"
        for (first, window), (other, other_window) in pairs
        if _same(first, other) and _overlap(window, other_window)
    ]


def _same(first: Recording, other: Recording) -> bool:
    one, two = first.markers.positions, other.markers.positions
    return one.shape == two.shape and bool(np.array_equal(one, two, equal_nan=True))


def _overlap(one: Span, two: Span) -> bool:
    return one is None or two is None or (one[0] < two[1] and two[0] < one[1])
