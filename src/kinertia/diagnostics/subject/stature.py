"""Does the stated stature belong to the person in the static trial? Landmarks show it, in any posture.

The distances from ankle to knee, to the front of the pelvis and to the shoulder add up to 0.79 to 0.84 of stature on
the reference recordings. Single distances vary by 4 to 5 % between people, their sum by less, since people with longer
legs have shorter trunks.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.model.joint_centres import find_landmarks

_PARTS = (("ankle_lateral", "knee_lateral"), ("knee_lateral", "asis"), ("asis", "acromion"))
_USUAL, _OFF = 0.815, 0.055
_POSSIBLE = (0.65, 1.0)
"""Nobody is shorter than from ankle to shoulder, or has a third of the stature above shoulders and below ankles."""


def stature(context: RecordingContext) -> Iterator[Finding]:
    """Report S104: a stature that the landmarks of a static trial contradict."""
    height_m = context.height_m
    if context.marker_set is None or height_m is None:
        return
    marks = find_landmarks(context.recording, context.marker_set)
    lengths = [
        sum(float(np.linalg.norm(marks[f"{one}_{side}"] - marks[f"{other}_{side}"])) for one, other in _PARTS)
        for side in "rl"
        if all(f"{name}_{side}" in marks for pair in _PARTS for name in pair)
    ]
    if not lengths:
        return
    length_m = float(np.mean(lengths))
    share = length_m / height_m
    if abs(share - _USUAL) <= _OFF:
        return
    limit = _USUAL + _OFF * float(np.sign(share - _USUAL))
    possible = _POSSIBLE[0] <= share <= _POSSIBLE[1]
    yield finding(
        "S104",
        context.at(),
        Severity.WARNING if possible else Severity.ERROR,
        stated_m=Quantity(height_m, "m"),
        implied_m=Quantity(length_m / _USUAL, "m"),
        length_m=Quantity(length_m, "m"),
        share=Quantity(share, "1", limit=limit, usual=(0.79, 0.84)),
    )
