"""Is one recording, or its forces, given for several trials? Counted twice, errors look half as large as they are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from kinertia.trial.data import Recording

Span = tuple[float, float] | None


def repeated_trials(recordings: Sequence[Recording], windows: Sequence[Span]) -> list[str]:
    """Pairs of trials whose markers or forces are the same to the last digit, over times that overlap.

    Args:
        recordings: of the trials.
        windows: what the user wants of each, if anything.
    """
    sentences = []
    for (first, window), (other, other_window) in combinations(zip(recordings, windows, strict=True), 2):
        if not _overlap(window, other_window):
            continue
        if _same(first.markers.positions, other.markers.positions):
            sentences.append(
                f"the trials '{first.name}' and '{other.name}' have the same markers to the last digit: one recording "
                "is listed twice, or its copy has another name; it counts twice, and error bars are too short: list it "
                "once, and give the file of the other trial"
            )
        elif _same_forces(first, other) and _overlap(_span(first), _span(other)):
            sentences.append(
                f"the trials '{first.name}' and '{other.name}' have the same forces to the last digit, but not the "
                "same markers: most likely the forces of one were given for both, and moments of the other are wrong: "
                "give each trial the forces that were measured with its markers"
            )
    return sentences


def _same(one: np.ndarray, two: np.ndarray) -> bool:
    return one.shape == two.shape and bool(np.array_equal(one, two, equal_nan=True))


def _same_forces(first: Recording, other: Recording) -> bool:
    """Whether both have the same loads; without any they say nothing."""
    if first.plates is None or other.plates is None or not np.nan_to_num(first.plates.force).any():
        return False
    return _same(first.plates.force, other.plates.force)


def _span(recording: Recording) -> tuple[float, float]:
    """Times (s) of the markers: pieces of one recording may come with the forces of the whole."""
    return float(recording.markers.time[0]), float(recording.markers.time[-1])


def _overlap(one: Span, two: Span) -> bool:
    return one is None or two is None or (one[0] < two[1] and two[0] < one[1])
