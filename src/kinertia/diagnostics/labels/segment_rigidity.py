"""L213 and L214: do the markers of a segment move together? Nothing else shows labels that are wrong in every file.

On twelve fault-free trials, from squats to runs, distances within pelvis, thighs, shanks, feet and arms change by up to
39 mm (from the tenth to the ninetieth percentile of the frames; 20 mm in walks), and those between landmarks that one
joint joins by up to 38 mm. Markers on the other leg, or on the segment above, change theirs by 70 to 500 mm. On soft
thighs the change may reach 75 mm, but their markers then move with no other segment. Of 1867 swaps of two labels of
pelvis and legs in eight of these trials that change a distance by more than 60 mm, all but six are found.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics import needs
from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.model.marker_set import MarkerSet, in_words
from kinertia.trial.data import FloatArray, Markers

_SEGMENT_M, _JOINT_M = Limit(0.06, "m", usual=(0.0, 0.04)), Limit(0.10, "m")
"""Within a segment, if a marker moves with another; of landmarks on both sides of a joint."""
_ELSEWHERE = 0.35
"""Change of the distances to the markers of the segment with which a marker goes, over that to those of its own."""
_OWN_WAY = ("torso", "head", "upper_arm", "forearm", "hand")
"""Arms swing with the other leg, and seem to go with it."""
_TOGETHER_M, _CLEARLY_BETTER = 0.04, 0.4
_PERCENTILES = (0.1, 0.9)
_SPREAD = 2.563 * np.sqrt(2.0)
"""Spread between these percentiles of the distance of two markers with noise of SD 1."""
_FEWEST_FRAMES = 11
_SOFT = ("torso", "head")
"""Shoulders and head move against the trunk."""
_NEIGHBOURS = (("thigh", "shank"), ("shank", "foot"))
_SEVERAL = {"thigh": "thighs", "shank": "shanks", "foot": "feet"}
_CROSSED = 0.7
"""Distances to the next segment of the other leg change 1.9 times as much and more in fault-free walks and runs, and
alike where both legs do the same; swapped, 0.1 to 0.57 times."""
_JOINED = (("ankle_lateral", "heel"), ("ankle_lateral", "metatarsal"), ("elbow_lateral", "wrist"))


class _Pair(NamedTuple):
    """Change (m) of the distance of two markers, its limit `limit_m`, and the part that joins them."""

    change_m: float
    one: str
    other: str
    joined: str
    limit_m: float


@check("L213", "L214", unless=needs.LENGTH_UNIT, segment=_SEGMENT_M, joint=_JOINT_M)
def rigidity(context: RecordingContext) -> Iterator[Finding]:
    """Report L213, one per marker that does not move with its segment; L214, one per segment on the wrong leg.

    Markers with faulty trajectories are left out. Noise beyond that of cameras widens the limits.
    """
    if context.marker_set is None:
        return
    faulty = context.trajectory_faults.labels
    markers = context.measured_markers
    markers = markers.select([label for label in markers.labels if label not in faulty])
    precise = context.marker_precision
    noise_m = _SPREAD * precise.noise_m if precise.noisy or precise.rounded else 0.0
    yield from _not_rigid(context, markers, context.marker_set, noise_m)
    yield from _crossed(context, markers, context.marker_set, float(np.hypot(_JOINT_M, noise_m)))


def _not_rigid(context: RecordingContext, markers: Markers, marker_set: MarkerSet, noise_m: float) -> Iterator[Finding]:
    far = [pair for pair in _pairs(markers, marker_set, noise_m) if pair.change_m > pair.limit_m]
    in_any_case = float(np.hypot(_JOINT_M, noise_m))
    marks = {label for name, labels in marker_set.landmarks.items() if "wand" not in name for label in labels}
    while far:
        count = Counter(label for pair in far for label in (pair.one, pair.other))
        worst = max(far)
        # a marker that is no landmark is more likely wrong, and one far from several others
        odd = max((worst.one, worst.other), key=lambda label: (label not in marks, count[label]))
        own = [pair for pair in far if odd in (pair.one, pair.other)]
        far = [pair for pair in far if pair not in own]
        mates = dict.fromkeys(label for pair in sorted(own, reverse=True) for label in (pair.one, pair.other))
        involved = (odd, *(label for label in mates if label != odd))
        if worst.change_m < in_any_case and not any(_elsewhere(markers, marker_set, one) for one in involved):
            continue
        evidence = {
            "change_m": Quantity(worst.change_m, "m", limit=worst.limit_m, usual=_SEGMENT_M.usual),
            "segment": Quantity(in_words(worst.joined)),
        }
        better = _better(markers, marker_set, odd, worst.change_m)
        yield with_evidence("L213", context.at(markers=involved), evidence | better)


def _elsewhere(markers: Markers, marker_set: MarkerSet, odd: str) -> bool:
    """Return whether this marker moves with another segment of the legs or the pelvis."""
    segments = {name: [one for one in own if one in markers.labels] for name, own in marker_set.segments.items()}
    changes = {
        name: np.median(_changes_m(markers, [(odd, mate) for mate in own if mate != odd]))
        for name, own in segments.items()
        if set(own) - {odd} and (odd in own or not name.startswith(_OWN_WAY))
    }
    mine = max((change for name, change in changes.items() if odd in segments[name]), default=0.0)
    return any(change < _ELSEWHERE * mine for change in changes.values())


def _better(markers: Markers, marker_set: MarkerSet, odd: str, change_m: float) -> dict[str, Quantity]:
    """Return, as evidence, the marker of another segment that this marker moves with; empty where there is none."""
    owners = {label: name for name, labels in marker_set.segments.items() for label in labels}
    mates = [mate for mate in markers.labels if mate in owners and owners[mate] != owners.get(odd)]
    changes = _changes_m(markers, [(odd, mate) for mate in mates], np.inf)
    best = int(np.argmin(changes)) if mates else -1
    if best < 0 or changes[best] > min(_TOGETHER_M, _CLEARLY_BETTER * change_m):
        return {}
    return {
        "better_segment": Quantity(in_words(owners[mates[best]])),
        "better_marker": Quantity(mates[best]),
        "better_change_m": Quantity(float(changes[best]), "m"),
    }


def _crossed(context: RecordingContext, markers: Markers, marker_set: MarkerSet, least_m: float) -> Iterator[Finding]:
    """Find whole segments that move with the other leg: a set without markers at the joints shows it in no other
    way."""
    crossed: dict[tuple[str, str], tuple[float, float]] = {}
    measured = 0
    for upper, lower in _NEIGHBOURS:
        changes = {
            (a, b): _neighbours_change_m(markers, marker_set, f"{upper}_{a}", f"{lower}_{b}")
            for a in "rl"
            for b in "rl"
        }
        own = min(changes["r", "r"], changes["l", "l"])
        others = max(changes["r", "l"], changes["l", "r"])
        measured += bool(np.isfinite([*changes.values()]).all())
        if np.isfinite([*changes.values()]).all() and others < _CROSSED * own and own > least_m:
            crossed[upper, lower] = own, others
    if not crossed:
        return
    # shanks that are swapped go with the other leg's thighs and feet; with one of them unseen, either may be swapped
    ends = [name for pair in crossed for name in pair if name != "shank"]
    parts = ["shank"] if len(crossed) == 2 else [*ends, *(["shank"] if measured < 2 else [])]
    own, others = next(iter(crossed.values()))
    involved = [f"{name}_{side}" for name in ("shank", *ends) for side in "rl"]
    labels = [label for name in involved for label in marker_set.segments[name] if label in markers.labels]
    yield finding(
        "L214",
        context.at(markers=tuple(dict.fromkeys(labels))),
        own_change_m=Quantity(own, "m", limit=least_m),
        crossed_change_m=Quantity(others, "m", limit=_CROSSED * own),
        segments=Quantity(" or ".join(_SEVERAL[part] for part in parts)),
    )


def _neighbours_change_m(markers: Markers, marker_set: MarkerSet, upper: str, lower: str) -> float:
    """Return the median change (m) of the distances between markers of two segments; NaN where one has none."""
    here = set(markers.labels)
    above, below = ([label for label in marker_set.segments.get(name, ()) if label in here] for name in (upper, lower))
    changes = _changes_m(markers, [(one, other) for one in above for other in below], np.nan)
    return float(np.nanmedian(changes)) if np.isfinite(changes).any() else np.nan


def _pairs(markers: Markers, marker_set: MarkerSet, noise_m: float) -> list[_Pair]:
    here = set(markers.labels)
    within, across = float(np.hypot(_SEGMENT_M, noise_m)), float(np.hypot(_JOINT_M, noise_m))
    named: list[tuple[str, str, str, float]] = []
    for name, labels in marker_set.segments.items():
        if not name.startswith(_SOFT):
            own = [label for label in labels if label in here]
            named += [(one, other, name, within) for one, other in combinations(own, 2)]
    for one, other in _JOINED:
        for side in "rl":
            both = [marker_set.landmarks.get(f"{name}_{side}", ()) for name in (one, other)]
            if all(labels and labels[0] in here for labels in both):
                named.append((both[0][0], both[1][0], f"{one.partition('_')[0]}_{side}", across))
    changes = _changes_m(markers, [(one, other) for one, other, *_ in named])
    return [_Pair(float(change), *which) for change, which in zip(changes, named, strict=True)]


def _changes_m(markers: Markers, pairs: Sequence[tuple[str, str]], unknown: float = 0.0) -> FloatArray:
    """Return by how much (p,) m the distance of each pair of markers changes; `unknown` where few frames show both."""
    place = {label: column for column, label in enumerate(markers.labels)}
    one, other = ([place[pair[end]] for pair in pairs] for end in (0, 1))
    apart: FloatArray = np.linalg.norm(markers.positions[:, one] - markers.positions[:, other], axis=2)
    seen = np.isfinite(apart)
    known = np.count_nonzero(seen, axis=0) >= _FEWEST_FRAMES
    always = known & seen.all(axis=0)
    changes = np.full(len(pairs), unknown)
    changes[always] = np.ptp(np.quantile(apart[:, always], _PERCENTILES, axis=0), axis=0)
    for pair in np.flatnonzero(known & ~always):
        changes[pair] = np.ptp(np.quantile(apart[seen[:, pair], pair], _PERCENTILES))
    return changes
