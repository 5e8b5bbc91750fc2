"""Does the stated stature belong to the person in the static trial? Lengths between landmarks say so, in any posture.

From ankle to knee, knee to front of the pelvis, and from there to the shoulder it is 0.79 to 0.84 of the stature on the
people at hand; lengths of parts vary by 4 to 5 % between people, their sum by less, as what one leg has more the trunk
has less.
"""

from __future__ import annotations

import numpy as np

from kinertia.model.joint_centres import find_landmarks
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Recording

_PARTS = (("ankle_lateral", "knee_lateral"), ("knee_lateral", "asis"), ("asis", "acromion"))
_USUAL, _OFF = 0.815, 0.055


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
