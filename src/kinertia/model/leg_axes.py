"""Judges the legs that a static trial gives: axes near those of a standing person, left and right nearly mirrored.

Limits are wider than what 22 static trials of 16 laboratories show, among them children who stand with feet turned out.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinertia.model import joint_centres as jc
from kinertia.model.marker_set import in_words

_DEGREE = float(np.pi / 180.0)


@dataclass(frozen=True)
class LegLimit:
    """A quantity of a leg, with the limits of one side and of the difference between both.

    Attributes:
        name: what it is, in words.
        centre, within: of one side; rad, or the length over the other side's.
        apart: largest difference between the sides.
        usual: largest distance from the centre that was found.
    """

    name: str
    centre: float
    within: float
    apart: float
    usual: float


KNEE = LegLimit("knee axis", 0.0, 35.0 * _DEGREE, 35.0 * _DEGREE, 28.0 * _DEGREE)
ANKLE = LegLimit("ankle axis", 6.0 * _DEGREE, 40.0 * _DEGREE, 35.0 * _DEGREE, 37.0 * _DEGREE)
FOOT = LegLimit("line from heel to toes", 8.0 * _DEGREE, 45.0 * _DEGREE, 45.0 * _DEGREE, 27.0 * _DEGREE)


@dataclass(frozen=True)
class Departure:
    """What a leg has that people do not.

    Attributes:
        part: the joint or the foot, "knee_r"; of both sides "knee".
        angle_rad: rotation outwards of one side from its reference, or the difference between the sides.
        between_sides: whether it is that difference.
        limit: what was exceeded.
    """

    part: str
    angle_rad: float
    between_sides: bool
    limit: LegLimit

    @property
    def how(self) -> str:
        """Say in which sense it departs."""
        if self.between_sides:
            return "different on the two sides"
        return "rotated outwards" if self.angle_rad > 0 else "rotated inwards"

    @property
    def sentence(self) -> str:
        """Say it in a few words, in degrees."""
        where = "" if self.between_sides else f"{in_words(self.part)}: "
        return f"{where}{self.limit.name} {self.how} by {abs(np.degrees(self.angle_rad)):.0f} degrees"


def departures(marks: jc.Landmarks) -> Iterator[Departure]:
    """Yield what is implausible in the legs of a static trial: rotations of knee axes from the line of the ASIS, of
    ankle axes from the perpendicular to the foot, and of feet from the pelvis' heading.

    Raises:
        MarkerSetError: a landmark is missing.
    """
    for joint, (limit, own) in _rotations(marks).items():
        apart = own["r"] - own["l"]
        far = [side for side in "rl" if abs(own[side] - limit.centre) > limit.within]
        for side in far:
            yield Departure(f"{joint}_{side}", own[side], False, limit)
        if not far and abs(apart) > limit.apart:
            yield Departure(joint, apart, True, limit)


def _rotations(marks: jc.Landmarks) -> dict[str, tuple[LegLimit, dict[str, float]]]:
    """Return the rotations (rad) outwards of knee, ankle and foot by side; NaN where landmarks define no axes."""
    found: dict[str, tuple[LegLimit, dict[str, float]]] = {"knee": (KNEE, {}), "ankle": (ANKLE, {}), "foot": (FOOT, {})}
    with np.errstate(invalid="ignore", divide="ignore"):
        pelvis, origin, width, depth = jc.pelvis_frame(marks)
        upright = jc.frame(np.array([0.0, 1.0, 0.0]), pelvis[:, 2])
        for side in "rl":
            leg = jc.leg_frames(marks, origin + pelvis @ jc.hip_in_pelvis(width, depth, "bell", side), side)
            axes = ((leg.knee_axis, upright), (leg.ankle_axis, leg.foot), (leg.foot[:, 2], upright))
            for (_, own), (axis, reference) in zip(found.values(), axes, strict=True):
                own[side] = jc.rotation_outwards(axis, reference, side)
    return found
