"""Compares distances between markers of one segment: whose body it is, the cameras' scale, and exchanged labels.

Medians over the frames are compared for pelvis, legs and feet, but not for the upper body, whose skin moves with the
arms.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

LOWER_BODY = ("pelvis", *(f"{name}_{side}" for name in ("thigh", "shank", "foot") for side in "rl"))
FEWEST_PAIRS = 6
"""Fewer pairs are not representative of a whole body."""
SAME_SESSION_M = Limit(0.009, "m", usual=(0.0, 0.0046))
"""RMS difference of the distances: re-applied markers are displaced by 5 to 10 mm along each axis, which makes 7 to
14."""
_FRAMES = 60
_SWAPPED_M = 0.05
"""Distances of markers with swapped labels differ by more."""
_RESOLVED_SHARE = 0.35
"""Share of that which may be left once the right labels are exchanged."""


@dataclass(frozen=True, eq=False)
class SegmentDistances:
    """Distances (m, m) m between the markers of the lower body that both trials have, and which of them count.

    Attributes:
        labels: labels of the m markers.
        static, trial: medians over the frames, of the static trial or of a model; NaN for markers that are never seen
            together.
        pairs: (p, 2) indices of two markers of one segment, both known.
        segments: (p,) index of the pair's segment in `LOWER_BODY`.
    """

    labels: tuple[str, ...]
    static: FloatArray
    trial: FloatArray
    pairs: NDArray[np.int_]
    segments: NDArray[np.int_]

    @classmethod
    def of(cls, static: Markers, trial: Markers, marker_set: MarkerSet) -> Self:
        """Compute the distances between the markers that the set has on pelvis, legs and feet."""
        both = set(static.labels) & set(trial.labels)
        segments = [[label for label in marker_set.segments.get(name, ()) if label in both] for name in LOWER_BODY]
        labels = tuple(dict.fromkeys(label for labels_of_segment in segments for label in labels_of_segment))
        place = {label: k for k, label in enumerate(labels)}
        before, after = (_medians(markers, labels) for markers in (static, trial))
        pairs = [
            (place[a], place[b], k)
            for k, labels_of_segment in enumerate(segments)
            for a, b in combinations(labels_of_segment, 2)
        ]
        known = np.array([pair for pair in pairs if before[pair[:2]] > 0 and after[pair[:2]] > 0], dtype=int).reshape(
            -1, 3
        )
        return cls(labels, before, after, known[:, :2], known[:, 2])

    def ratio(self) -> float:
        """Return the median ratio of the pairs' distances, trial over static trial."""
        before, after = self.lengths()
        return float(np.median(after / before))

    def lengths(self) -> tuple[FloatArray, FloatArray]:
        """Return the distances (p,) m of the pairs in the static trial, and in the trial."""
        at = tuple(self.pairs.T)
        return self.static[at], self.trial[at]

    def worst_pair(self) -> str:
        """Return the two labels whose distances differ most: "RASI to LASI"."""
        worst = int(np.argmax(np.abs(self.differences())))
        return " to ".join(self.labels[k] for k in self.pairs[worst])

    def differences(self, order: NDArray[np.int_] | None = None) -> FloatArray:
        """Return by how much (p,) m the pairs are farther apart in the trial, with its markers in another order."""
        trial = self.trial if order is None else self.trial[np.ix_(order, order)]
        result: FloatArray = trial[tuple(self.pairs.T)] - self.static[tuple(self.pairs.T)]
        return result


def _medians(markers: Markers, labels: tuple[str, ...]) -> FloatArray:
    """Compute median distances (m, m) m between markers over a few frames."""
    places = markers.select(labels).positions[:: -(-len(markers.time) // _FRAMES)]
    distances = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    seen = np.isfinite(distances).any(axis=0)
    return np.where(seen, np.nanmedian(np.where(seen, distances, 0.0), axis=0), np.nan)


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
        involved = np.isin(distances.pairs, pairs).any(axis=1)
        if not involved.any() or off[involved].max() <= _SWAPPED_M:
            continue
        after = np.nan_to_num(np.abs(distances.differences(_exchanged(distances, pairs))[involved]), nan=np.inf)
        if after.max() < _RESOLVED_SHARE * off[involved].max():
            gain = float(off[involved].sum() - after.sum())
            found.append(_Exchange(pairs, float(off[involved].max()), float(after.max()), gain))
    return max(found, key=lambda swap: swap.gain_m, default=None)


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
