"""Varies how people walk: pace, and how trunk and arms are held and swung."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

_PACE_SD = 0.12
"""Adults of an age and sex walk comfortably at speeds that differ by 7 to 17 % (Bohannon 1997, Age Ageing 26:15)."""
_SLOWEST, _FASTEST = 0.75, 1.35
_SWING_SD, _POSTURE_SD_RAD = 0.3, float(np.radians(4.0))
"""Of the logarithm of how far an angle swings, and of its mean (no source)."""
_SWUNG = ("lumbar_extension", "lumbar_bending", "lumbar_rotation", "arm_flex", "arm_add", "elbow_flex")
_HELD = ("lumbar_extension", "arm_flex", "arm_add", "elbow_flex")
"""Coordinates of trunk and arms: the legs' decide where feet stand."""


@dataclass(frozen=True)
class Manner:
    """What is another's than the package's walk.

    Attributes:
        pace: the same steps this many times as fast.
        posture_rad: by coordinate without side, added to its mean.
        swing: by coordinate without side, factor on how far it moves about its mean.

    >>> Manner(pace=1.2).of("knee_angle_r")
    (0.0, 1.0)
    """

    pace: float = 1.0
    posture_rad: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    swing: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Manner:
        """Somebody's; both sides alike."""
        pace = float(np.clip(rng.normal(1.0, _PACE_SD), _SLOWEST, _FASTEST))
        swing = {name: float(np.exp(rng.normal(0.0, _SWING_SD))) for name in _SWUNG}
        return cls(pace, {name: float(rng.normal(0.0, _POSTURE_SD_RAD)) for name in _HELD}, swing)

    def of(self, coordinate: str) -> tuple[float, float]:
        """What is added to the mean of a coordinate (rad), and the factor on its swing."""
        name = coordinate.removesuffix("_r").removesuffix("_l")
        return self.posture_rad.get(name, 0.0), self.swing.get(name, 1.0)
