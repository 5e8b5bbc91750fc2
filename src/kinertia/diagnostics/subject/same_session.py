"""Do a person's recordings belong together: the same camera scale, and forces with their own markers?

Compared are pairs of markers of one segment, at least 80 mm apart: the median of their ratios, with a standard error by
their scatter, since skin moves markers on soft thighs by several percent. Of ten fault-free pairs of a motion and a
standing trial (seven people) the median is 0.15 to 0.85 % below 1, as thighs and feet change shape under the weight:
within 0.4 % and 0.9 standard errors of the usual 0.45 %. Three trials in motion of one person differ by 0.15 % at most.
A scale 1.5 % off is found in all of them, but for one that is larger in a run. In two of twelve pairs of children most
segments with a single distance are 1 to 4 % shorter, and the pelvis is not.

Walks of one person are so similar that interchanged force files look like displaced plates. But the vertical velocity
follows its own forces: in nine pairs of walks of one person, measured and synthetic, the residual with their own forces
is 0.6 to 0.8 times the residual with the forces of the other walk.

Both are compared over the same time, since residuals of short windows are smaller. Where two trials are parts of one
recording, they are compared where they overlap, and there the forces are the same.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext, odd_ones
from kinertia.diagnostics.evidence.body_motion import (
    LEAST_WINDOW_S,
    ForceVelocity,
    force_velocities,
    without_trend,
)
from kinertia.diagnostics.evidence.segment_distances import FEWEST_PAIRS, SAME_SESSION_M, SegmentDistances
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.trial.sampled_data import rms, span_s

AGAINST_STANDING = Limit(-0.0045)
"""Usual share by which distances are longer in motion than in a standing trial."""
FAR_M = Limit(0.08, "m")
"""Skin that moves a marker by 1 mm makes more than 1 % of a shorter distance."""
OTHER_SCALE, ERRORS = Limit(0.01, usual=(-0.004, 0.004)), Limit(3.0)
"""Distances are longer or shorter than usual by more than this share, and by more standard errors."""
_ALIKE = 2.0 / 3.0
"""Smallest share of the segments that differ in the same direction."""
_SEVERAL, _SHOWN = 3, 0.5
"""A single distance of a segment may be wrong by up to 4 % because of skin alone, in children's feet and shanks above
all, and those of several segments may be so in the same direction: one with so many distances must show so much of the
scale."""
_MEDIAN_ERROR = 1.25 * 1.4826
"""Standard error of a median of n numbers, times the root of n and over their median deviation, if they are normal."""
_BETTER, _EACH_BETTER = 0.8, 0.92
"""Of both trials together, and of either (0.51 to 0.88 where they are interchanged). Where one is late and the other
early, either may seem to go with the other's forces, but not both."""


@dataclass(frozen=True)
class CameraScale:
    """Share by which distances in one recording are too long compared with another, beyond the usual.

    Attributes:
        error, se: median share and its standard error.
        pairs, alike, segments: number of distances, and how many of the segments differ in the same direction.
        shown: most of it that a segment with several distances shows, as a share.
        residual_m: RMS difference of the distances that is left once the scale is corrected.
    """

    error: float
    se: float
    pairs: int
    alike: int
    segments: int
    shown: float
    residual_m: float

    @property
    def differs(self) -> bool:
        """Whether a different camera scale is the likeliest explanation."""
        far = abs(self.error) > max(OTHER_SCALE, ERRORS * self.se)
        alike = self.alike >= _ALIKE * self.segments and self.shown >= _SHOWN
        return far and alike and self.residual_m <= SAME_SESSION_M

    def finding(self, trial: str, reference: str, sign: float = 1.0) -> Finding:
        """Return S205 for this trial; `sign` is -1 where the other recording has the wrong scale."""
        return finding(
            "S205",
            Where(trial=trial),
            scale_error=Quantity(sign * self.error, "1", limit=OTHER_SCALE, usual=OTHER_SCALE.usual, sd=self.se),
            segments=Quantity(self.alike, "1"),
            pairs=Quantity(self.pairs, "1"),
            reference=Quantity(reference),
        )


def camera_scale(distances: SegmentDistances, usual: float) -> CameraScale | None:
    """Estimate the scale of a recording, beyond the share by which its distances are usually longer; None where it is
    equal or too few distances show it.
    """
    scale = _scale(distances, usual)
    return scale if scale is not None and scale.differs else None


@check("S205", apart=FAR_M, scale=OTHER_SCALE, errors=ERRORS, standing=AGAINST_STANDING)
def trial_scales(context: PersonContext) -> Iterator[Finding]:
    """Report S205: of two trials with different scales, the one that the static trial and other trials contradict, or
    both where neither is contradicted.
    """
    marker_set = context.marker_set
    if marker_set is None:
        return

    def between(recording: RecordingContext, reference: RecordingContext, usual: float = 0.0) -> CameraScale | None:
        return _scale(SegmentDistances.of(recording.all_markers, reference.all_markers, marker_set), usual)

    def size(scale: CameraScale | None) -> float:
        return np.nan if scale is None else abs(scale.error)

    for first, other in combinations(context.trials, 2):
        scale = between(first, other)
        if scale is None or not scale.differs:
            continue
        further: list[tuple[RecordingContext, float]] = [(standing, AGAINST_STANDING) for standing in context.standing]
        further += [(trial, 0.0) for trial in context.trials if trial not in (first, other)]
        witnesses = [
            (size(between(witness, first, usual)), size(between(witness, other, usual))) for witness, usual in further
        ]
        for odd in odd_ones(first, other, witnesses):
            peer, sign = (first, 1.0) if odd is other else (other, -1.0)
            yield scale.finding(odd.name, f"trial {peer.name}", sign)


def _scale(distances: SegmentDistances, usual: float) -> CameraScale | None:
    before, after = distances.lengths()
    far = before > FAR_M
    if far.sum() < FEWEST_PAIRS:
        return None
    shares = (after / before)[far] - 1.0
    share = float(np.median(shares))
    # pairs with a common marker have correlated errors: there are as many independent errors as markers
    markers = len(np.unique(distances.pairs[far]))
    error = _MEDIAN_ERROR * float(np.median(np.abs(shares - share))) / np.sqrt(markers)
    owners = distances.segments[far]
    off = [np.median(shares[owners == k]) - usual for k in np.unique(owners)]
    alike = sum(np.sign(offset) == np.sign(share - usual) for offset in off)
    several = [offset for offset, k in zip(off, np.unique(owners), strict=True) if (owners == k).sum() >= _SEVERAL]
    shown = max((float(offset / (share - usual)) for offset in several), default=0.0) if share != usual else 0.0
    residual_m = rms(after / (1.0 + share - usual) - before)
    return CameraScale(share - usual, float(error), len(shares), int(alike), len(off), shown, residual_m)


@check("S304")
def interchanged_forces(person: PersonContext) -> Iterator[Finding]:
    """Report S304: two trials whose forces seem to be interchanged, one finding for each."""
    loaded = [trial for trial in person.trials if trial.trial is not None]
    for pair in combinations(loaded, 2):
        with_others = [_with_forces_of(a, b) for a, b in (pair, pair[::-1])]
        kept = [_residual(_over(other, trial.velocities)) for trial, other in zip(pair, with_others, strict=True)]
        crossed = [_residual(_over(trial.velocities, other)) for trial, other in zip(pair, with_others, strict=True)]
        if np.less(crossed, np.multiply(_EACH_BETTER, kept)).all() and sum(crossed) < _BETTER * sum(kept):
            for k, trial in enumerate(pair):
                yield finding(
                    "S304",
                    Where(trial=trial.name),
                    left_own=Quantity(kept[k], "1"),
                    left_crossed=Quantity(crossed[k], "1", limit=_EACH_BETTER * kept[k]),
                    other_trial=Quantity(pair[1 - k].name),
                )


def _with_forces_of(recording: RecordingContext, other: RecordingContext) -> list[ForceVelocity]:
    assert recording.trial is not None
    assert other.trial is not None
    return force_velocities(replace(recording.trial, loads=other.trial.loads), recording.segment_of_label)


def _over(windows: Sequence[ForceVelocity], parts: Sequence[ForceVelocity]) -> Sequence[ForceVelocity]:
    """Return the parts where they overlap these windows; whole where none does for long enough."""
    cut = [part.cut(window.time[0], window.time[-1]) for part in parts for window in windows]
    return [part for part in cut if len(part.time) > 1 and span_s(part.time) >= LEAST_WINDOW_S] or parts


def _residual(parts: Sequence[ForceVelocity]) -> float:
    """Return the share of the vertical velocities of pelvis and markers that forces do not explain; NaN if unknown."""
    shown, left = [], []
    for part in parts:
        by_forces = without_trend(part.time, part.by_forces)[:, 1]
        for velocity in (part.pelvis, part.centre):
            up = without_trend(part.time, velocity)[:, 1]
            shown.append(np.square(up).sum())
            left.append(np.square(up - by_forces).sum())
    return float(np.sqrt(sum(left) / sum(shown))) if shown else float("nan")
