"""Torques that are not about the centre of pressure: the vertical moment of a plate in the place of the free moment.

About another point the horizontal forces turn, too: by their distance from it. On 25 sound trials the free moment is at
most 0.023 m (0.033 m in synthetic laboratories) times the vertical force (95th percentile), or no point accounts for
more than a fifth of it. About the middle of the plate it is 0.037 to 0.086 m, and 1.9 to 11 times what is left about
that point.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, centre_of_pressure, free_moment
from kinertia.trial.data import FloatArray, PlateLoads
from kinertia.trial.rms import rms

_LONG_ARM_M, _USUAL_PERCENT = 0.034, 95.0
_ACCOUNTED = 1.8
_FEWEST = 20


def torque_point_doubts(plates: PlateLoads) -> list[str]:
    """Plates whose torques about the vertical are those about a fixed point."""
    shown = []
    for name, whole in zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True):
        wrench = whole[whole[:, 1] > FIRM_LOAD_N]
        if len(wrench) < _FEWEST:
            continue
        torque = free_moment(wrench)
        arm = float(np.percentile(np.abs(torque) / wrench[:, 1], _USUAL_PERCENT))
        point, left = _fixed_point(wrench, torque)
        if arm > _LONG_ARM_M and rms(torque) > _ACCOUNTED * rms(left):
            shown.append(
                f"those of {name} are {rms(torque):.1f} N m (RMS), and {rms(left):.1f} about the point at x "
                f"{point[0]:.2f}, z {point[1]:.2f} m"
            )
    if not shown:
        return []
    return [
        f"the torques about the vertical are not free moments, but those about a fixed point: {'; '.join(shown)}; "
        "export the free moment (Tz, about the centre of pressure) in place of the moment about the plate's middle or "
        "origin (Mz)"
    ]


def _fixed_point(wrench: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The point (x, z) m about which torques (k,) N m would be moments of wrenches (k, 6), and what is left."""
    acts = centre_of_pressure(wrench)
    forces = wrench[:, [0, 2]]
    about_origin = acts[:, 2] * forces[:, 0] - acts[:, 0] * forces[:, 1]
    (along_z, along_x), *_ = np.linalg.lstsq(forces * [-1.0, 1.0], torque - about_origin, rcond=None)
    point = np.array([along_x, along_z])
    left: FloatArray = torque - about_origin - forces @ np.array([-along_z, along_x])
    return point, left
