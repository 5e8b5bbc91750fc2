"""Do stated stature and floor belong to the person in the static trial? Landmarks say so, in any posture.

From ankle to knee, knee to front of the pelvis, and from there to the shoulder it is 0.79 to 0.84 of the stature on the
people at hand; lengths of parts vary by 4 to 5 % between people, their sum by less, as what one leg has more the trunk
has less.
"""

from __future__ import annotations

import numpy as np

from kinertia.model.joint_centres import find_landmarks
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers, Recording

_PARTS = (("ankle_lateral", "knee_lateral"), ("knee_lateral", "asis"), ("asis", "acromion"))
_USUAL, _OFF = 0.815, 0.055
_LOWEST_M = (0.008, 0.050)
"""A marker's own radius is 5 mm and more; soles are under both feet, and markers on the side of a foot are low."""
_FLAT_M = 0.04
"""Heels, and metatarsals, of seven people who stand are up to 12 mm higher on one side than on the other."""


def stature_doubts(static: Recording, marker_set: MarkerSet, height_m: float) -> list[str]:
    """What speaks against a stature (m).

    Args:
        static: the person standing, bent or straight.
        marker_set: which label is which landmark.
        height_m: as stated.
    """
    marks = find_landmarks(static, marker_set)
    lengths = [
        sum(float(np.linalg.norm(marks[f"{one}_{side}"] - marks[f"{other}_{side}"])) for one, other in _PARTS)
        for side in "rl"
        if all(f"{name}_{side}" in marks for pair in _PARTS for name in pair)
    ]
    if not lengths:
        return []
    length = float(np.mean(lengths))
    if abs(length / height_m - _USUAL) <= _OFF:
        return []
    return [
        f"the stated stature, {height_m:.2f} m, does not go with the markers: from ankle over knee and pelvis to the "
        f"shoulder they are {length:.2f} m apart, {100 * length / height_m:.0f} % of it; usual are "
        f"{100 * (_USUAL - _OFF):.0f} to {100 * (_USUAL + _OFF):.0f} %, which is a stature of about "
        f"{length / _USUAL:.2f} m: correct height_m"
    ]


def floor_doubts(static: Markers, marker_set: MarkerSet) -> list[str]:
    """Feet that stand above the floor or below it.

    Of fourteen people at hand, of eight laboratories, with bare feet and in running shoes, the lowest marker of toes,
    metatarsals and heels is 23 to 44 mm above the floor.
    """
    named = [marker_set.landmarks.get(f"{name}_{side}", ()) for name in ("heel", "metatarsal", "toe") for side in "rl"]
    labels = [label for own in named for label in own if label in static.labels]
    heights = static.select(labels).positions[..., 1]
    shown = np.isfinite(heights).any(axis=0)
    if not all(named[:4]) or not shown.any():
        return []
    lowest = int(np.argmin(np.where(shown, np.nanmedian(np.where(shown, heights, 0.0), axis=0), np.inf)))
    height_m = float(np.nanmedian(heights[:, lowest]))
    low, high = _LOWEST_M
    if low <= height_m <= high:
        return []
    return [
        f"the lowest marker of the feet, {labels[lowest]}, is {1e3 * height_m:.0f} mm above the floor while the person "
        f"stands; usual are 20 to 45 mm: the floor of the cameras is not that of the plates, or there are thick soles; "
        f"calibrate the cameras' origin on the floor, or shift the markers"
    ]


def flat_feet_doubts(static: Markers, marker_set: MarkerSet) -> list[str]:
    """A foot that is not on the floor as the other is: the axes of a foot are those of one that stands flat."""
    apart = {}
    for name in ("heel", "metatarsal"):
        places = [static.arranged(marker_set.landmarks.get(f"{name}_{side}", ())[:1])[..., 1] for side in "rl"]
        if all(np.isfinite(each).any() for each in places):
            right_m, left_m = (float(np.nanmedian(each)) for each in places)
            apart[name] = right_m - left_m
    if not apart:
        return []
    name, higher_m = max(apart.items(), key=lambda one: abs(one[1]))
    if abs(higher_m) < _FLAT_M:
        return []
    side, other = ("right", "left") if higher_m > 0 else ("left", "right")
    return [
        f"in the static trial the {name} of the {side} foot is {1e3 * abs(higher_m):.0f} mm higher than that of the "
        f"{other} one: that foot does not stand flat on the floor (a bent knee, a raised heel, a step), and the axes "
        "of foot and ankle are turned by that; record the static trial with both feet flat, or take moments of that "
        "ankle with care where the person cannot"
    ]
