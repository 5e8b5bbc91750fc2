"""Defines `RangeOfMotion`: the range of healthy people's joints from the literature, and its variation.

Signs and zeros are OpenSim's: flexion of hips, knees and elbows, dorsiflexion, adduction, internal rotation, inversion
and extension of the trunk are positive. No ranges are given for arms and forearm rotation: Cardan angles of a shoulder
are not the goniometer's.
"""

from dataclasses import dataclass

import numpy as np

TOLERANCE_DEG = 5.0
"""Error of zero angles in a static trial with slightly bent joints."""
_SURE = 3.0
"""Number of SDs from the mean that is assumed to include everyone."""


@dataclass(frozen=True)
class RangeOfMotion:
    """Limits of a joint's range, rad.

    Attributes:
        low, high: mean limits of healthy people.
        low_sd, high_sd: standard deviations between people.

    Examples:
        >>> from kinertia.model.range_of_motion import range_of_motion
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
