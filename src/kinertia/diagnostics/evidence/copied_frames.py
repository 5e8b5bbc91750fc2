"""Finds frames that repeat the one before in all markers: dropped frames that were filled with copies.

On 17 measured recordings of motions and ten synthetic ones no frame repeats the one before it.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.findings.limit import Limit
from kinertia.trial.data import BoolArray, FloatArray, Markers
from kinertia.trial.sampled_data import runs

COPIED_SHARE = Limit(0.25)
"""Share of copies beyond which the recording was upsampled: at half the rate, each repeated once, half are copies."""
FEWEST_FRAMES = 11
LEAST_MOTION_M = 1e-3
_LONGEST_S = 0.15
"""Longest time between two measured frames; a person who stands still, or a frozen marker, does so for longer."""
_ALIKE = 0.9
"""Share of the markers that are still at the same time, although they move in other frames."""


@dataclass(frozen=True, eq=False)
class CopiedFrames:
    """Frames that repeat the one before them.

    Attributes:
        copied: (n,) which marker frames are copies.
        amid_motion: markers stop in them and go on just before and after; those at the ends do not count.
        insertions: how many of them were put in between two consecutive frames, which delays everything after them,
            whereas the others replace dropped frames.
    """

    copied: BoolArray
    amid_motion: bool
    insertions: int

    @classmethod
    def of(cls, markers: Markers) -> Self:
        """Find the copied frames of the markers of a motion."""
        if len(markers.time) < FEWEST_FRAMES:
            return cls(np.zeros(len(markers.time), dtype=bool), False, 0)
        distance = np.linalg.norm(np.diff(markers.positions, axis=0), axis=2)
        repeated = brief_runs(_repeated(distance), markers.rate_hz)
        copied = np.concatenate([[False], repeated])
        return cls(copied, _amid_motion(distance, repeated), _insertions(markers.positions, distance, repeated))

    @property
    def share(self) -> float:
        """Share of the steps from frame to frame that are copies."""
        return float(self.copied[1:].mean()) if len(self.copied) > 1 else 0.0

    @property
    def fill_lost_frames(self) -> bool:
        """Whether the copies fill single dropped frames, rather than upsample the whole recording."""
        return 0.0 < self.share <= COPIED_SHARE and self.amid_motion


def without_copied_frames(markers: Markers) -> Markers:
    """Return the markers with copies of dropped frames as gaps (NaN), which are bridged; unchanged without copies.

    Upsampled recordings, more than a quarter of which is copied, are left as they are.
    """
    copies = CopiedFrames.of(markers)
    if not copies.fill_lost_frames:
        return markers
    return replace(markers, positions=np.where(copies.copied[:, None, None], np.nan, markers.positions))


def brief_runs(mask: BoolArray, rate_hz: float) -> BoolArray:
    """Return the mask without runs that last longer than the time between two measured frames."""
    kept = mask.copy()
    for first, last in runs(mask):
        if last - first + 1 > _LONGEST_S * rate_hz:
            kept[first : last + 1] = False
    return kept


def _repeated(distance: FloatArray) -> BoolArray:
    """Find frames (n - 1,) in which nearly all markers stay exactly where they were although the person moves."""
    seen = np.isfinite(distance)
    count = seen.sum(axis=1)
    same = (seen & (distance == 0.0)).sum(axis=1) > _ALIKE * np.maximum(count, 1)
    goes_on = distance[~same][seen[~same]]
    if not goes_on.size or np.median(goes_on) < LEAST_MOTION_M:
        return np.zeros(len(distance), dtype=bool)
    return np.asarray(same & (count > 0))


def _amid_motion(distance: FloatArray, repeated: BoolArray) -> bool:
    """Return whether markers stop in repeated frames (n - 1,) and move on beside them.

    Rounded coordinates also repeat while a person hardly moves.
    """
    if not repeated.any():
        return False
    hidden = ~np.isfinite(distance).any(axis=1, keepdims=True)
    distance = np.where(hidden, 0.0, distance)
    moving = float(np.nanmedian(distance[~repeated])) if (~repeated).any() else np.inf
    beside = [np.nanmedian(distance[[first - 1, last + 1]], axis=1).min() for first, last in _inner(repeated)]
    return max(beside, default=0.0) > max(LEAST_MOTION_M, 0.5 * moving)


def _insertions(position: FloatArray, distance: FloatArray, repeated: BoolArray) -> int:
    """Count copies after which the motion resumes where it stopped; after dropped frames it resumes farther away."""
    inserted = 0
    for first, last in _inner(repeated):
        if first < 1 or last + 3 > len(position) - 1:
            continue
        gone = np.linalg.norm(position[last + 2] - position[first], axis=1)
        step = (distance[first - 1] + distance[last + 2]) / 2
        known = np.isfinite(gone) & np.isfinite(step)
        if known.any() and np.median(step[known]) > LEAST_MOTION_M:
            inserted += (last - first + 1) * bool(
                gone[known].sum() < (1.0 + (last - first + 1) / 2) * step[known].sum()
            )
    return inserted


def _inner(repeated: BoolArray) -> list[tuple[int, int]]:
    return [run for run in runs(repeated) if run[0] > 0 and run[1] < len(repeated) - 1]
