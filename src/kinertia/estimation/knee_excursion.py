"""Decides whether trials show the axes of the knees, from how far the knees bend."""

from collections.abc import Sequence

import numpy as np

from kinertia.model.gait27 import KNEES
from kinertia.motion.inverse_kinematics import InverseKinematics

_STRIDE_RAD = float(np.radians(30.0))
"""Half of what a knee bends in the swing phase of walking."""
_SQUAT_RAD = float(np.radians(80.0))
"""More than a knee bends in walking, less than in a squat."""
_WITHIN = 0.02, 0.98
"""Quantiles of the frames; what single frames have is left out."""


def show_knee_axes(poses: Sequence[InverseKinematics]) -> bool:
    """Decide whether the trials show the axes of both knees: two with a stride of both legs, or one with a squat.

    Args:
        poses: inverse kinematics of the trials with the 27-DOF model.
    """
    excursions = [_least_excursion_rad(ik) for ik in poses]
    return sum(each > _STRIDE_RAD for each in excursions) > 1 or any(each > _SQUAT_RAD for each in excursions)


def _least_excursion_rad(ik: InverseKinematics) -> float:
    """Return the range of flexion of the knee that bends less."""
    return min(_range_rad(ik.q[:, ik.coordinates.index(name)]) if name in ik.coordinates else 0.0 for name in KNEES)


def _range_rad(angle: np.ndarray) -> float:
    known = angle[np.isfinite(angle)]
    return float(np.diff(np.quantile(known, _WITHIN))[0]) if known.size else 0.0
