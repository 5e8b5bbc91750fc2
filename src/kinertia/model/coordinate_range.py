"""Defines `Range`, the range of values of a coordinate, and the ranges of healthy people's joints.

A body has one pose, but coordinates have several values for it: three angles rotate a segment as three others do (half
a turn more of the first and the last), and an arm that is rotated by half a turn with the elbow bent backwards fits its
markers nearly as well. Ranges select one of them; and where markers have errors, a joint beyond the anatomical range of
motion (`range_of_motion`) is less likely than a displaced marker.

Signs and zeros are OpenSim's: flexion of hips, knees and elbows, dorsiflexion, adduction, internal rotation, inversion
and extension of the trunk are positive. No ranges are given for arms and forearm rotation: Cardan angles of a shoulder
are not the goniometer's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

CLAMPED_SD = 0.01
"""Standard deviation (rad or m) beyond a range that the model clamps: half a degree."""
SD = 0.35
"""Standard deviation (rad or m) beyond a range that is not anatomical: 20 degrees. A shoulder may go there."""
TOLERANCE_DEG = 5.0
"""Error of zero angles in a static trial with slightly bent joints."""
_SURE = 3.0
"""Number of SDs from the mean that is assumed to include everyone."""
_HYPEREXTENSION = (-10.0, TOLERANCE_DEG / _SURE)
"""Knee extension from which joints count as hypermobile (Beighton et al. 1973, Ann Rheum Dis 32:413)."""
_DEGREES = {
    "hip_flexion": (-9.8 - 15.0, 6.8, 122.3 + 15.0, 6.1),
    "hip_adduction": (-45.9, 9.3, 26.9, 4.1),
    "hip_rotation": (-47.2, 6.3, 47.3, 6.0),
    "knee_angle": (*_HYPEREXTENSION, 142.5, 5.4),
    "ankle_angle": (-56.2, 6.1, 40.6, 5.2),
    "subtalar_angle": (-20.7, 5.0, 36.8, 4.5),
    "lumbar_extension": (-80.0 - 15.0, 5.0, 30.0 + 15.0, 5.0),
    "lumbar_bending": (-35.0, 5.0, 35.0, 5.0),
    "lumbar_rotation": (-45.0, 5.0, 45.0, 5.0),
    "elbow_flex": (-0.6, 3.1, 142.9, 5.6),
}
"""Low end, its SD, high end, its SD. Legs and elbows: goniometer, 109 men and boys (Boone and Azen 1979, J Bone Joint
Surg Am 61:756); dorsiflexion: under the body's weight, 26 men (Calatayud et al. 2015, Int J Sports Phys Ther 10:197);
trunk: American Academy of Orthopaedic Surgeons (1965), Joint motion, which gives no SD. The pelvis' markers tilt it by
up to 15 degrees, which is added to flexion and extension of hips and trunk."""
_OTHER_NAMES = {"hip_add": "hip_adduction", "hip_rot": "hip_rotation", "knee_flex": "knee_angle"}
_COUNTED_BACKWARDS = ("knee_angle", "elbow_flex")
"""Coordinates whose flexion is negative in some models."""


@dataclass(frozen=True)
class RangeOfMotion:
    """Limits of a joint's range, rad.

    Attributes:
        low, high: mean limits of healthy people.
        low_sd, high_sd: standard deviations between people.

    Examples:
        >>> from kinertia.model.coordinate_range import range_of_motion
        >>> inversion = range_of_motion("subtalar_angle_r")
        >>> np.degrees(inversion.of_anybody).round(1).tolist()
        [-35.7, 50.3]
    """

    low: float
    low_sd: float
    high: float
    high_sd: float

    @property
    def of_anybody(self) -> tuple[float, float]:
        """Limits that include practically everyone: mean and three SDs."""
        return self.low - _SURE * self.low_sd, self.high + _SURE * self.high_sd

    @property
    def beyond_sd(self) -> tuple[float, float]:
        """Standard deviation at the low and the high limit: people's, and the tolerance of zero."""
        tolerance = np.radians(TOLERANCE_DEG)
        return float(np.hypot(self.low_sd, tolerance)), float(np.hypot(self.high_sd, tolerance))

    @property
    def reversed(self) -> "RangeOfMotion":
        """The same range for a coordinate of opposite sign."""
        return RangeOfMotion(-self.high, self.high_sd, -self.low, self.low_sd)

    @classmethod
    def exactly(cls, low: float, high: float) -> "RangeOfMotion":
        """Make the range of one person whose limits are known, rad: the tolerance is three SDs."""
        sd = float(np.radians(TOLERANCE_DEG)) / _SURE
        return cls(low, sd, high, sd)


def range_of_motion(coordinate: str, middle: float = 0.0) -> RangeOfMotion | None:
    """Return the range of a coordinate by its name, with or without side; None if none is known.

    Args:
        coordinate: its name in OpenSim's gait models.
        middle: of the model's own range, rad: in a knee whose middle is negative, flexion is negative.
    """
    joint = coordinate.removesuffix("_r").removesuffix("_l")
    joint = _OTHER_NAMES.get(joint, joint)
    if joint not in _DEGREES:
        return None
    known = RangeOfMotion(*np.radians(_DEGREES[joint]).tolist())
    return known.reversed if joint in _COUNTED_BACKWARDS and middle < 0.0 else known


@dataclass(frozen=True)
class Range:
    """Smallest and largest value (rad or m) of a coordinate.

    Attributes:
        low, high: the ends.
        clamped: inverse kinematics stays within; else it may go beyond if the markers require it.
        stated: stated by the user for this person, in place of the anatomical range.

    Examples:
        >>> from kinertia.model.coordinate_range import Range
        >>> Range(-0.1, 2.6, clamped=True).middle
        1.25
    """

    low: float
    high: float
    clamped: bool
    stated: bool = False

    @property
    def middle(self) -> float:
        """Midpoint of the range."""
        return (self.low + self.high) / 2

    def anatomical(self, coordinate: str) -> RangeOfMotion | None:
        """Return the known range of motion of a coordinate that has this range in the model; None if there is none."""
        if self.stated:
            return RangeOfMotion.exactly(self.low, self.high)
        return range_of_motion(coordinate, self.middle)


UNKNOWN = Range(-np.inf, np.inf, clamped=False)
ANYTHING = Range(-np.inf, np.inf, clamped=False, stated=True)


@dataclass(frozen=True)
class Bounds:
    """The ranges of c coordinates as arrays; infinite where there is none.

    Attributes:
        low, high: (c,) ends: anatomical where known, except for clamped ranges that end before.
        low_sd, high_sd: (c,) standard deviation beyond them, rad or m.
        least, most: (c,) ends of the clamped ones.
        anatomical: (c,) True where the anatomical range is known, or the user states it.
    """

    low: np.ndarray
    high: np.ndarray
    low_sd: np.ndarray
    high_sd: np.ndarray
    least: np.ndarray
    most: np.ndarray
    anatomical: np.ndarray

    @classmethod
    def of(cls, coordinates: Sequence[str], ranges: Mapping[str, Range]) -> Self:
        """Collect the ranges of these coordinates, in this order."""
        stated = [ranges.get(name, UNKNOWN) for name in coordinates]
        known = [stated_range.anatomical(name) for stated_range, name in zip(stated, coordinates, strict=True)]
        ends = np.array([_ends(*pair) for pair in zip(stated, known, strict=True)]).reshape(-1, 6)
        low, high, low_sd, high_sd, least, most = ends.T
        anatomical = np.array([motion_range is not None for motion_range in known], dtype=bool)
        return cls(low, high, low_sd, high_sd, least, most, anatomical)

    @cached_property
    def ends(self) -> tuple[tuple[float, np.ndarray, np.ndarray], ...]:
        """Side (1 or -1), value (c,) and SD (c,) of all ends, including clamped ends that are farther out."""
        clamped = np.full(len(self.low), CLAMPED_SD)
        return (
            (1.0, self.high, self.high_sd),
            (-1.0, self.low, self.low_sd),
            (1.0, np.where(self.most > self.high, self.most, np.inf), clamped),
            (-1.0, np.where(self.least < self.low, self.least, -np.inf), clamped),
        )

    def beyond(self, q: np.ndarray) -> np.ndarray:
        """Return how far coordinates (n, c) are beyond their ranges, with the sign of the side; NaN where unknown."""
        result: np.ndarray = q - np.clip(q, self.low, self.high)
        return result

    def sd(self, q: np.ndarray) -> np.ndarray:
        """Return the standard deviation (n, c) that applies to coordinates (n, c) on their side of the range."""
        return np.where(q < self.low, self.low_sd, self.high_sd)

    def clamped(self, q: np.ndarray) -> np.ndarray:
        """Return the nearest coordinates (n, c) within the clamped ranges."""
        result: np.ndarray = np.clip(q, self.least, self.most)
        return result

    def held(self, q: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """Return the mask (n, c) of coordinates at a limit of a clamped range whose pull (n, c) is outwards."""
        return ((q <= self.least) & (pull < 0)) | ((q >= self.most) & (pull > 0))


def _ends(stated: Range, known: RangeOfMotion | None) -> tuple[float, float, float, float, float, float]:
    """Return low and high, their SDs, and the clamped ends, in the order of `Bounds`."""
    least, most = (stated.low, stated.high) if stated.clamped else (-np.inf, np.inf)
    if known is None:
        sd = CLAMPED_SD if stated.clamped else SD
        return stated.low, stated.high, sd, sd, least, most
    low_sd, high_sd = known.beyond_sd
    low, low_sd = (least, CLAMPED_SD) if least >= known.low else (known.low, low_sd)
    high, high_sd = (most, CLAMPED_SD) if most <= known.high else (known.high, high_sd)
    return low, high, low_sd, high_sd, least, most
