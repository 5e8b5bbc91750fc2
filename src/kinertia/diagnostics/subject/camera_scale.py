"""Were two trials of a person recorded with the same scale of the cameras? Another calibration makes all distances
longer or shorter alike; a marker that moved, or skin, makes only some so.

Compared are pairs of markers of one segment, at least 80 mm apart: the median of their ratios, with a standard error by
their scatter, since skin moves markers on soft thighs by several percent. Of ten sound pairs of a motion and a standing
trial (seven people) the median is 0.15 to 0.85 % below 1, as thighs and feet change shape under the weight: within
0.4 % and 0.9 standard errors of the usual 0.45 %. Three trials in motion of one person differ by 0.15 % at most. A
scale 1.5 % off is found in all of them, but for one that is larger in a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers

_FAR_M = 0.08
"""Skin that moves a marker by 1 mm makes more than 1 % of a shorter distance."""
_FEWEST_PAIRS = 6
_AGAINST_STANDING = -0.0045
"""Usual share by which distances are longer in motion than in a standing trial."""
_OTHER_SCALE, _ERRORS = 0.01, 3.0
"""Distances are longer or shorter than usual by more than this share, and by more standard errors."""
_ALIKE = 2.0 / 3.0
"""At least as many of the segments differ in the same direction."""
_LEFT_M = 0.009
"""RMS difference that may be left once the scale is corrected; markers put on anew leave more."""
_MEDIAN_ERROR = 1.25 * 1.4826
"""Standard error of a median of n numbers, times the root of n and over their median deviation, if they are normal."""


class _Scale(NamedTuple):
    """How many times as long distances are: their median less 1, beyond the usual, its error, and who agrees."""

    share: float
    beyond: float
    error: float
    pairs: int
    alike: int
    segments: int

    def differs(self) -> bool:
        far = abs(self.beyond) > max(_OTHER_SCALE, _ERRORS * self.error)
        return far and self.alike >= _ALIKE * self.segments

    def sentence(self, there: str, usual: str) -> str:
        return (
            f"distances between markers of one segment are {100 * abs(self.share):.1f} % "
            f"{'longer' if self.share > 0 else 'shorter'} than in {there} (median of {self.pairs}; {self.alike} of "
            f"{self.segments} segments alike; in sound trials {usual}): most likely the cameras were calibrated anew "
            "in between, with another length of the wand in the software for one of them, or else the markers were put "
            "on anew; lengths and joint centres are wrong by as much, and joint moments with them: take trials of one "
            f"calibration, or correct the scale of the file that is wrong, by about {100 * abs(self.beyond):.1f} %"
        )


def scale_trouble(distances: SegmentDistances) -> str:
    """Why a motion was not recorded with the static trial's scale of the cameras; empty where it may be."""
    scale = _scale(distances, _AGAINST_STANDING)
    return "" if scale is None else scale.sentence("the static trial", "0.1 to 0.9 % shorter")


def trial_scales(trials: Sequence[tuple[str, Markers]], marker_set: MarkerSet) -> list[tuple[str, str]]:
    """Trials of one person, all in motion, that were recorded with another scale than the first; with a sentence.

    Args:
        trials: name and markers of each.
        marker_set: which marker is on which segment.
    """
    found = []
    for (first, markers), (name, others) in product(trials[:1], trials[1:]):
        scale = _scale(SegmentDistances.of(markers, others, marker_set), 0.0)
        if scale is not None:
            found.append((name, scale.sentence(f"'{first}'", "less than 0.5 %")))
    return found


def _scale(distances: SegmentDistances, usual: float) -> _Scale | None:
    """The scale of a trial, against the share by which its distances are usually longer; None where it is the same."""
    before, after = distances.lengths()
    far = before > _FAR_M
    if far.sum() < _FEWEST_PAIRS:
        return None
    shares = (after / before)[far] - 1.0
    share = float(np.median(shares))
    # pairs with a marker in common err together: there are as many errors as markers
    markers = len(np.unique(distances.pairs[far]))
    error = _MEDIAN_ERROR * float(np.median(np.abs(shares - share))) / np.sqrt(markers)
    owners = distances.segments[far]
    off = [np.median(shares[owners == k]) - usual for k in np.unique(owners)]
    alike = sum(np.sign(one) == np.sign(share - usual) for one in off)
    scale = _Scale(share, share - usual, error, len(shares), int(alike), len(off))
    left = after / (1.0 + scale.beyond) - before
    return scale if scale.differs() and np.sqrt(np.square(left).mean()) <= _LEFT_M else None
