"""Defines `FileOutputs`: joint angles, moments and powers that other software left in a trial's file."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FileOutputs:
    """Model outputs of the legs, with the names and axes of Plug-in Gait.

    Attributes:
        time: (f,) s, all frames of the file.
        values: "LHipAngles" -> (f, 3) deg, "LHipMoment" -> N m, "LHipPower" -> W, the last two per kg or not, as the
            file has them; NaN where they are missing.
    """

    time: FloatArray
    values: Mapping[str, FloatArray]
