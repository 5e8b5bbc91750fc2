"""Is the static trial one of the person who walks, in the same session? Distances between markers of one segment say
so.

Compared are pelvis, legs and feet: medians over the frames. The upper body is left out, whose skin moves with the arms.
On ten sound pairs of trials, measured in five laboratories, distances differ by 4.6 mm RMS at most, and single ones by
17 mm; their ratio is within 1.2 %.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.diagnostics.subject.camera_scale import scale_trouble

_OTHER_BODY = 0.05
"""Median share by which the distances may differ."""
_FEWEST_PAIRS = 6
_SWAPPED_M = 0.05
"""Distances of markers with swapped labels differ by more."""
_CURED = 0.35
"""Share of that which may be left once the right labels are exchanged."""
_ELSEWHERE_M = 0.03
_SAME_SESSION_M = 0.009
"""RMS difference of the distances: markers put on anew are 5 to 10 mm elsewhere along each axis, which makes 7 to 14.
"""


def body_trouble(distances: SegmentDistances) -> str:
    """Why static trial and trial cannot be used together: swapped labels, or another person; empty where they may."""
    if not len(distances.pairs):
        return ""
    return swapped_labels(distances) or swapped_pairs(distances) or _another_body(distances)


def session_doubts(distances: SegmentDistances) -> list[str]:
    """What speaks against markers that were left in place between static trial and trial, if `body_trouble` found
    nothing.
    """
    if not len(distances.pairs):
        return []
    off = distances.differences()
    typical = float(np.sqrt(np.square(off).mean()))
    if scaled := scale_trouble(distances):
        return [scaled]
    far = np.abs(off) > _ELSEWHERE_M
    # one marker that moved takes all of its distances along
    about = [np.abs(off[(distances.pairs == k).any(axis=1)]) for k in range(len(distances.labels))]
    moved = int(np.argmax([np.median(one) if len(one) else 0.0 for one in about]))
    alone = (distances.pairs[far] == moved).any(axis=1)
    rest = off[~(distances.pairs == moved).any(axis=1)]
    if far.any() and alone.all() and np.sqrt(np.square(rest).mean() if len(rest) else 0.0) <= _SAME_SESSION_M:
        mates = distances.pairs[far][0]
        other = distances.labels[int(mates[0] if mates[1] == moved else mates[1])]
        names = f"{distances.labels[moved]}" if len(about[moved]) > 1 else f"{distances.labels[moved]} or {other}"
        return [
            f"the marker {names} sits elsewhere than in the static trial (its distances in the segment differ by up to "
            f"{1e3 * about[moved].max():.0f} mm; to {other}, for one): it was moved or put back in between; record the "
            f"static trial anew, or leave the marker out"
        ]
    if len(off) >= _FEWEST_PAIRS and typical > _SAME_SESSION_M:
        return [
            f"distances between markers of one segment differ from the static trial's by {1e3 * typical:.0f} mm (RMS "
            f"of {len(off)}; most of all {distances.worst_pair()}): the static trial is of another session, "
            "with the markers put on anew, or of another person; give the one of this session"
        ]
    return []


def swapped_labels(distances: SegmentDistances, there: str = "the static trial") -> str:
    """Which two labels fit once they are exchanged, here or there; empty where none do."""
    off = np.abs(distances.differences())
    suspects = sorted({int(k) for pair in distances.pairs[off > _SWAPPED_M] for k in pair})
    best, cured = (0.0, ("", "", 0.0, 0.0)), False
    for a, b in combinations(range(len(distances.labels)), 2):
        if a not in suspects and b not in suspects:
            continue
        own = np.isin(distances.pairs, (a, b)).any(axis=1)
        if not own.any() or off[own].max() <= _SWAPPED_M:
            continue
        order = np.arange(len(distances.labels))
        order[[a, b]] = b, a
        after = np.abs(distances.differences(order)[own])
        gain = float(off[own].sum() - after.sum())
        if np.nan_to_num(after, nan=np.inf).max() < _CURED * off[own].max() and gain > best[0]:
            cured = True
            best = (gain, (distances.labels[a], distances.labels[b], float(off[own].max()), float(after.max())))
    if not cured:
        return ""
    one, other, before_m, after_m = best[1]
    return (
        f"the markers {one} and {other} look swapped, here or in {there}: distances to the others of their "
        f"segments differ by up to {1e3 * before_m:.0f} mm between the two, and by {1e3 * after_m:.0f} mm once they "
        "are exchanged; correct the labels"
    )


def swapped_pairs(distances: SegmentDistances, there: str = "the static trial") -> str:
    """Which two pairs of labels of one segment fit once both are exchanged: front and back, for one."""
    off = np.abs(distances.differences())
    if not (off > _SWAPPED_M).any():
        return ""
    mates = {k: set(distances.pairs[(distances.pairs == k).any(axis=1)].ravel()) for k in np.unique(distances.pairs)}
    best: tuple[float, tuple[int, int, int, int]] | None = None
    for a, b in combinations(mates, 2):
        for c, d in combinations(mates, 2):
            if a >= c or len({a, b, c, d}) < 4 or not {b, c, d} <= mates[a]:
                continue
            order = np.arange(len(distances.labels))
            order[[a, b, c, d]] = b, a, d, c
            own = np.isin(distances.pairs, (a, b, c, d)).any(axis=1)
            after = np.nan_to_num(np.abs(distances.differences(order)[own]), nan=np.inf)
            if off[own].max() > _SWAPPED_M and after.max() < _CURED * off[own].max():
                gain = float(off[own].sum() - after.sum())
                best = max(best or (0.0, (a, b, c, d)), (gain, (a, b, c, d)), key=lambda one: one[0])
    if best is None:
        return ""
    one, two, three, four = (distances.labels[k] for k in best[1])
    return (
        f"the markers {one} and {two}, and {three} and {four} look swapped, here or in {there}: distances in "
        f"their segment differ by up to {1e3 * off.max():.0f} mm between the two, and fit once they are exchanged "
        "(or the segment's other markers are); correct the labels"
    )


def _another_body(distances: SegmentDistances) -> str:
    if len(distances.pairs) < _FEWEST_PAIRS:
        return ""
    (before, after), ratio = distances.lengths(), distances.ratio()
    if abs(ratio - 1) <= _OTHER_BODY:
        return ""
    worst = int(np.argmax(np.abs(after - before)))
    first, second = (distances.labels[k] for k in distances.pairs[worst])
    word = "longer" if ratio > 1 else "shorter"
    return (
        f"the distances between markers of one segment are {100 * abs(ratio - 1):.0f} % {word} than in the static "
        f"trial (median of {len(before)}; {first} to {second}: {1e3 * after[worst]:.0f} mm, there "
        f"{1e3 * before[worst]:.0f} mm); the static trial is of another person or in another unit: give the one of "
        f"this person and session"
    )
