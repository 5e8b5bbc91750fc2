"""Compares distances between markers of one segment: they show whose body it is, and the cameras' scale.

Medians over the frames are compared for pelvis, legs and feet, but not for the upper body, whose skin moves with the
arms.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from kinertia.findings.limit import Limit
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

LOWER_BODY = ("pelvis", *(f"{name}_{side}" for name in ("thigh", "shank", "foot") for side in "rl"))
FEWEST_PAIRS = 6
"""Fewer pairs are not representative of a whole body."""
SAME_SESSION_M = Limit(0.009, "m", usual=(0.0, 0.0046))
"""RMS difference of the distances: re-applied markers are displaced by 5 to 10 mm along each axis, which makes 7 to
14."""
_FRAMES = 60


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
        labels = tuple(dict.fromkeys(label for own in segments for label in own))
        place = {label: k for k, label in enumerate(labels)}
        before, after = (_medians(markers, labels) for markers in (static, trial))
        pairs = [(place[a], place[b], k) for k, own in enumerate(segments) for a, b in combinations(own, 2)]
        known = np.array([one for one in pairs if before[one[:2]] > 0 and after[one[:2]] > 0], dtype=int).reshape(-1, 3)
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
