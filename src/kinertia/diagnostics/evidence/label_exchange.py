"""Finds labels that fit a static trial or a model once they are swapped."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

_SWAPPED_M = 0.05
"""Distances of markers with swapped labels differ by more."""
_RESOLVED_SHARE = 0.35
"""Share of that which may be left once the right labels are exchanged."""


class _Exchange(NamedTuple):
    """Candidate exchange of pairs of columns, with the distance errors (m) before and after, and the gain."""

    pairs: tuple[tuple[int, int], ...]
    before_m: float
    after_m: float
    gain_m: float


def swapped_labels(distances: SegmentDistances, trial: str, reference: str) -> Iterator[Finding]:
    """Report L212: the one swap of two labels, or of two pairs within a segment, that fits best; no finding where none
    does.

    Args:
        distances: between the markers of a segment, in the reference and in a trial.
        trial: name of the trial.
        reference: "static trial", "model", or another.
    """
    best = _best(distances, _single(distances)) or _best(distances, _double(distances))
    if best is None:
        return
    for pair in best.pairs:
        yield finding(
            "L212",
            Where(trial=trial, markers=tuple(distances.labels[k] for k in pair)),
            before_m=Quantity(best.before_m, "m", limit=_SWAPPED_M),
            after_m=Quantity(best.after_m, "m"),
            method=Quantity("distances"),
            reference=Quantity(reference),
        )


def _best(distances: SegmentDistances, candidates: Iterator[tuple[tuple[int, int], ...]]) -> _Exchange | None:
    """Return the exchange that resolves the differences of its markers; of several, the one that gains most."""
    off, found = np.abs(distances.differences()), []
    for pairs in candidates:
        own = np.isin(distances.pairs, pairs).any(axis=1)
        if not own.any() or off[own].max() <= _SWAPPED_M:
            continue
        after = np.nan_to_num(np.abs(distances.differences(_exchanged(distances, pairs))[own]), nan=np.inf)
        if after.max() < _RESOLVED_SHARE * off[own].max():
            gain = float(off[own].sum() - after.sum())
            found.append(_Exchange(pairs, float(off[own].max()), float(after.max()), gain))
    return max(found, key=lambda one: one.gain_m, default=None)


def _exchanged(distances: SegmentDistances, pairs: Sequence[tuple[int, int]]) -> NDArray[np.int_]:
    order = np.arange(len(distances.labels))
    for a, b in pairs:
        order[[a, b]] = b, a
    return order


def _single(distances: SegmentDistances) -> Iterator[tuple[tuple[int, int], ...]]:
    """Yield every pair of labels of which one has a distance that differs."""
    off = np.abs(distances.differences())
    suspects = {int(k) for pair in distances.pairs[off > _SWAPPED_M] for k in pair}
    return (((a, b),) for a, b in combinations(range(len(distances.labels)), 2) if {a, b} & suspects)


def _double(distances: SegmentDistances) -> Iterator[tuple[tuple[int, int], ...]]:
    """Yield two pairs of labels of one segment (such as front and back) where any distance differs."""
    if not (np.abs(distances.differences()) > _SWAPPED_M).any():
        return
    mates = {
        int(k): set(distances.pairs[(distances.pairs == k).any(axis=1)].ravel().tolist())
        for k in np.unique(distances.pairs)
    }
    for a, b in combinations(mates, 2):
        for c, d in combinations(mates, 2):
            if a < c and len({a, b, c, d}) == 4 and {b, c, d} <= mates[a]:
                yield (a, b), (c, d)
