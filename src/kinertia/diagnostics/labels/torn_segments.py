"""Do the markers of a segment move together? Labels that are wrong in every file alike show in nothing else.

On twelve sound trials, from squats to runs, distances within pelvis, thighs, shanks, feet and arms change by up to
39 mm (from the tenth to the ninetieth percentile of the frames; 20 mm in walks), and those between landmarks that one
joint joins by up to 38 mm. Markers on the other leg, or on the segment above, change theirs by 70 to 500 mm. Soft
thighs may come up to 75 mm, but then their markers go with no other segment. Of 1867 exchanges of two labels of pelvis
and legs in eight of these trials which change a distance by more than 60 mm, this tells all but six.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import FloatArray, Markers

_TORN_M, _APART_M = 0.06, 0.10
"""Of one segment, if one of the markers goes with another; of landmarks on both sides of a joint, and in any case."""
_ELSEWHERE = 0.35
"""Change of the distances to the markers of the segment with which a marker goes, over that to those of its own."""
_OWN_WAY = ("torso", "head", "upper_arm", "forearm", "hand")
"""Arms swing with the other leg, and seem to go with it."""
_TOGETHER_M, _MUCH_BETTER = 0.04, 0.4
_MOST_LOWEST = (0.1, 0.9)
_FEWEST_FRAMES = 11
_SOFT = ("torso", "head")
"""Shoulders and head move against the trunk."""
_NEIGHBOURS = (("thigh", "shank"), ("shank", "foot"))
_SEVERAL = {"thigh": "thighs", "shank": "shanks", "foot": "feet"}
_CROSSED = 0.7
"""Distances to the next segment of the other leg change 1.9 times as much and more in sound walks and runs, and alike
where both legs do the same; exchanged, 0.1 to 0.57 times."""
_JOINED = (("ankle_lateral", "heel"), ("ankle_lateral", "metatarsal"), ("elbow_lateral", "wrist"))


class _Pair(NamedTuple):
    """By how much (m) the distance of two markers changes, and what joins them."""

    change_m: float
    one: str
    other: str
    joined: str


def torn_segments_trouble(markers: Markers, marker_set: MarkerSet) -> str:
    """Which markers of one segment do not move together, and with which others one of them does; empty where all do.

    Args:
        markers: of a motion.
        marker_set: which marker is on which segment.
    """
    far = [pair for pair in _pairs(markers, marker_set) if pair.change_m > _limit_m(pair)]
    worst = max(far, default=None)
    if worst is None or (worst.change_m < _APART_M and not _elsewhere(markers, marker_set, far)):
        return _crossed(markers, marker_set)
    usual = "less than 40 mm are usual"
    involved = list(dict.fromkeys(label for pair in sorted(far, reverse=True) for label in (pair.one, pair.other)))
    shown = ", ".join(involved[:8]) + (f" and {len(involved) - 8} more" if len(involved) > 8 else "")
    return (
        f"markers {worst.joined} do not move together: the distance from {worst.one} to {worst.other} changes by "
        f"{1e3 * worst.change_m:.0f} mm during the trial ({usual}){_rather(markers, marker_set, far, worst)}; "
        f"labels are swapped, or the marker set has markers on the wrong segment (look at {shown}): correct the "
        "labels, in the static trial as well, or the marker set"
    )


def _elsewhere(markers: Markers, marker_set: MarkerSet, far: Sequence[_Pair]) -> bool:
    """Does any marker of these pairs go with another segment of the legs or the pelvis?"""
    segments = {name: [one for one in own if one in markers.labels] for name, own in marker_set.segments.items()}
    for odd in {label for pair in far for label in (pair.one, pair.other)}:
        changes = {
            name: np.median(_changes_m(markers, [(odd, mate) for mate in own if mate != odd]))
            for name, own in segments.items()
            if set(own) - {odd} and (odd in own or not name.startswith(_OWN_WAY))
        }
        mine = max((change for name, change in changes.items() if odd in segments[name]), default=0.0)
        if any(change < _ELSEWHERE * mine for change in changes.values()):
            return True
    return False


def _crossed(markers: Markers, marker_set: MarkerSet) -> str:
    """Whole segments that go with those of the other leg: a set without markers at the joints has no other sign."""
    for upper, lower in _NEIGHBOURS:
        above, below = _SEVERAL[upper], _SEVERAL[lower]
        changes = {
            (a, b): _neighbours_change_m(markers, marker_set, f"{upper}_{a}", f"{lower}_{b}")
            for a in "rl"
            for b in "rl"
        }
        own = min(changes["r", "r"], changes["l", "l"])
        crossed = max(changes["r", "l"], changes["l", "r"])
        if np.isfinite([*changes.values()]).all() and crossed < _CROSSED * own and own > _APART_M:
            return (
                f"the markers of the {above} go with the {below} of the other leg: distances to them change by "
                f"{1e3 * crossed:.0f} mm during the trial, and to those of their own leg by {1e3 * own:.0f} mm; the "
                f"left and right labels of the {above} or of the {below} are swapped: correct them, in the static "
                "trial as well, if they are swapped there"
            )
    return ""


def _neighbours_change_m(markers: Markers, marker_set: MarkerSet, upper: str, lower: str) -> float:
    """Median over the pairs of a marker of each; NaN where one has none."""
    here = set(markers.labels)
    above, below = ([label for label in marker_set.segments.get(name, ()) if label in here] for name in (upper, lower))
    changes = _changes_m(markers, [(one, other) for one in above for other in below], np.nan)
    return float(np.nanmedian(changes)) if np.isfinite(changes).any() else np.nan


def _limit_m(pair: _Pair) -> float:
    return _TORN_M if pair.joined.startswith("of the segment") else _APART_M


def _pairs(markers: Markers, marker_set: MarkerSet) -> list[_Pair]:
    here = set(markers.labels)
    named: list[tuple[str, str, str]] = []
    for name, labels in marker_set.segments.items():
        if not name.startswith(_SOFT):
            own = [label for label in labels if label in here]
            named += [(one, other, f"of the segment {name}") for one, other in combinations(own, 2)]
    for one, other in _JOINED:
        for side in "rl":
            both = [marker_set.landmarks.get(f"{name}_{side}", ()) for name in (one, other)]
            if all(labels and labels[0] in here for labels in both):
                words = f"on both sides of the {'right' if side == 'r' else 'left'} {one.partition('_')[0]}"
                named.append((both[0][0], both[1][0], words))
    changes = _changes_m(markers, [(one, other) for one, other, _ in named])
    return [_Pair(float(change), *which) for change, which in zip(changes, named, strict=True)]


def _rather(markers: Markers, marker_set: MarkerSet, far: Sequence[_Pair], worst: _Pair) -> str:
    """Which marker of another segment goes with that of the two which is rather wrong: no landmark, if one of them."""
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    marks = {label for name, labels in marker_set.landmarks.items() if "wand" not in name for label in labels}
    torn = Counter(label for pair in far for label in (pair.one, pair.other))
    odd = max((worst.one, worst.other), key=lambda label: (label not in marks, torn[label]))
    mates = [mate for mate in markers.labels if mate in owners and owners[mate] != owners.get(odd)]
    changes = _changes_m(markers, [(odd, mate) for mate in mates], np.inf)
    rather = [_Pair(float(change), odd, mate, owners[mate]) for change, mate in zip(changes, mates, strict=True)]
    best = min(rather, default=worst)
    if best.change_m > min(_TOGETHER_M, _MUCH_BETTER * worst.change_m):
        return ""
    return f", and that from {best.one} to {best.other} ({best.joined}) by {1e3 * best.change_m:.0f} mm"


def _changes_m(markers: Markers, pairs: Sequence[tuple[str, str]], unknown: float = 0.0) -> FloatArray:
    """(p,) m, by how much the distance of each two markers changes; `unknown` where few frames show both."""
    place = {label: column for column, label in enumerate(markers.labels)}
    one, other = ([place[pair[end]] for pair in pairs] for end in (0, 1))
    apart: FloatArray = np.linalg.norm(markers.positions[:, one] - markers.positions[:, other], axis=2)
    seen = np.isfinite(apart)
    known = np.count_nonzero(seen, axis=0) >= _FEWEST_FRAMES
    always = known & seen.all(axis=0)
    changes = np.full(len(pairs), unknown)
    changes[always] = np.ptp(np.quantile(apart[:, always], _MOST_LOWEST, axis=0), axis=0)
    for pair in np.flatnonzero(known & ~always):
        changes[pair] = np.ptp(np.quantile(apart[seen[:, pair], pair], _MOST_LOWEST))
    return changes
