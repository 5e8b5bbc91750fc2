"""Holds what the torque columns of a force file contain."""

from typing import NamedTuple

import numpy as np


class TorqueColumns(NamedTuple):
    """Content of the torque columns of one plate in its file, while the plate was loaded.

    Attributes:
        lever_arm_m: median of the horizontal torque over the vertical force, m; NaN where the point of application does
            not move, or the plate was hardly loaded.
        rms_nm: RMS torque about X, Y and Z, N m.
        belongs_to: index of the other plate whose load the torque follows; None if there is none.
        height_m: median height of the point of application, m; NaN where the plate was hardly loaded.
    """

    lever_arm_m: float
    rms_nm: tuple[float, float, float]
    belongs_to: int | None
    height_m: float = np.nan
