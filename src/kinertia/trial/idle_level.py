"""Subtracts what a force plate reads while nobody stands on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ZEROED_N, ZEROED_NM = 3.0, 1.0
"""Plates that were zeroed read less than this while nobody stands on them."""
_NOWHERE = (np.nan, np.nan, np.nan)


class IdleReading(NamedTuple):
    """What a plate reads while nobody stands on it.

    Attributes:
        level_n: median force along X, Y, Z, N; NaN where it is hardly ever idle.
        drift_n: by how much the vertical force changes over the recording, by a straight line, N; NaN likewise.
        peak_n: the largest vertical force of the whole recording, N.
        rings_s: for how long the vertical force is below zero just before feet land and just after they leave, s; 0
            where it does not do both.
        like_steps: the vertical force comes and goes as under feet, of whatever size.
        level_nm: median moment about the ground origin, N m; where the file has none while the plate is idle, that of
            the level in the middle of the loads.
        twist_nm: largest component of the same about the middle of the loads, N m.
        noise_n: deviation of the vertical force, N; NaN where it is hardly ever idle.
        constant: the level is the same whenever nobody stands on the plate.
        subtracted: the level has been taken off the loads.
    """

    level_n: tuple[float, float, float]
    drift_n: float
    peak_n: float
    rings_s: float
    like_steps: bool = False
    level_nm: tuple[float, float, float] = _NOWHERE
    twist_nm: float = 0.0
    noise_n: float = np.nan
    constant: bool = False
    subtracted: bool = False

    @property
    def off_zero(self) -> bool:
        """Whether the level is constant and larger than a zeroed plate's."""
        return self.constant and (max(map(abs, self.level_n)) > ZEROED_N or abs(self.twist_nm) > ZEROED_NM)

    @property
    def left_n(self) -> tuple[float, float, float]:
        """Of `level_n`, what is still in the loads."""
        return (0.0, 0.0, 0.0) if self.subtracted else self.level_n

    def added(self, times: float, force: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (k, 3) and moment (k, 3) with so many times the level added."""
        return force + times * np.array(self.level_n), moment + times * np.array(self.level_nm)
