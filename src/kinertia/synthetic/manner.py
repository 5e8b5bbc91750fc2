"""Varies the manner of walking: pace, and posture and swing of trunk and arms."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

import numpy as np

_PACE_SD = 0.12
"""Comfortable speeds of adults of one age and sex differ by 7 to 17 % (Bohannon 1997, Age Ageing 26:15)."""
_SLOWEST, _FASTEST = 0.75, 1.35
_SWING_SD, _POSTURE_SD_RAD = 0.3, float(np.radians(4.0))
"""Standard deviations of the logarithm of an angle's amplitude, and of its mean (no source)."""
_SWUNG = ("lumbar_extension", "lumbar_bending", "lumbar_rotation", "arm_flex", "arm_add", "elbow_flex")
_HELD = ("lumbar_extension", "arm_flex", "arm_add", "elbow_flex")
"""Coordinates of trunk and arms: those of the legs determine where the feet are."""


@dataclass(frozen=True)
class Manner:
    """Differences of a person's walk from the package's.

    Attributes:
        pace: factor on the speed of the same steps.
        posture_rad: by coordinate without side, added to its mean.
        swing: by coordinate without side, factor on its amplitude about the mean.

    >>> Manner(pace=1.2).of("knee_angle_r")
    (0.0, 1.0)
    """

    pace: float = 1.0
    posture_rad: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    swing: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a manner of walking, the same on both sides."""
        pace = float(np.clip(rng.normal(1.0, _PACE_SD), _SLOWEST, _FASTEST))
        swing = {name: float(np.exp(rng.normal(0.0, _SWING_SD))) for name in _SWUNG}
        return cls(pace, {name: float(rng.normal(0.0, _POSTURE_SD_RAD)) for name in _HELD}, swing)

    def of(self, coordinate: str) -> tuple[float, float]:
        """Return what is added to the mean of a coordinate (rad), and the factor on its amplitude."""
        name = coordinate.removesuffix("_r").removesuffix("_l")
        return self.posture_rad.get(name, 0.0), self.swing.get(name, 1.0)
