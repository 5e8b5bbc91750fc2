"""Defines the reading of an unloaded force plate, and subtracts it from the loads."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ZEROED_N, ZEROED_NM = 3.0, 1.0
"""Zeroed plates read less than this while unloaded."""
_NOWHERE = (np.nan, np.nan, np.nan)


class UnloadedReading(NamedTuple):
    """Reading of a force plate while it is unloaded.

    Attributes:
        level_n: median force along X, Y, Z, N; NaN if it is hardly ever unloaded.
        drift_n: linear change of the vertical force over the recording, N; NaN likewise.
        peak_n: the largest vertical force of the whole recording, N.
        overshoot_s: for how long the vertical force is below zero just before foot contact and just after foot off, s;
            0 unless it does both.
        like_steps: the vertical force rises and falls as under feet, at any scale.
        level_nm: median moment about the ground origin, N m; if the file has none for the unloaded plate, the moment of
            `level_n` acting at the mean centre of pressure.
        twist_nm: largest component of the moment about the mean centre of pressure, N m.
        noise_n: standard deviation of the vertical force, N; NaN if the plate is hardly ever unloaded.
        constant: the level is the same whenever the plate is unloaded.
        subtracted: the level has been subtracted from the loads.
    """

    level_n: tuple[float, float, float]
    drift_n: float
    peak_n: float
    overshoot_s: float
    like_steps: bool = False
    level_nm: tuple[float, float, float] = _NOWHERE
    twist_nm: float = 0.0
    noise_n: float = np.nan
    constant: bool = False
    subtracted: bool = False

    @property
    def off_zero(self) -> bool:
        """Whether the level is constant and larger than that of a zeroed plate."""
        return self.constant and (max(map(abs, self.level_n)) > ZEROED_N or abs(self.twist_nm) > ZEROED_NM)

    @property
    def remaining_n(self) -> tuple[float, float, float]:
        """Part of `level_n` that is still in the loads, N."""
        return (0.0, 0.0, 0.0) if self.subtracted else self.level_n

    def added(self, times: float, force: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return force (k, 3) and moment (k, 3) with `times` times the level added."""
        return force + times * np.array(self.level_n), moment + times * np.array(self.level_nm)
