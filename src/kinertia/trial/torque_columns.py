"""What the torque columns of a force file hold: free moments, about the vertical, or something else.

A force file has a point of application beside each torque, and nothing but its maker sees to it that they go together.
At the centre of pressure no torque is horizontal, by definition: in eleven sound force files the median is 0.0 mm times
the vertical force, the 99th percentile at most 10 mm (where forces are smallest). Torques about the middle of the plate
are horizontal, too, by some 20 mm and more. Where the point stays in its place (at the plate's middle, at the origin),
it is no centre of pressure, and force and torque are what acts there: nothing is wrong.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, PlateLoads, TorqueColumns
from kinertia.trial.exchanged_torques import exchanged_torques
from kinertia.trial.rms import rms

_FEWEST = 20
_MOVES_M = 0.02
"""Under a foot that lands and leaves the centre of pressure moves by 0.2 m, in squats by 0.1."""
_LONG_ARM_M = 0.005
"""A load that is off by so much moves joint moments by 2 to 4 N m."""
_LITTLE, _SOME_NM, _LARGEST_NM = 0.1, 0.2, 10.0
"""RMS of free moments of walks and runs: 0.8 to 6 N m."""


def torque_columns(force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[TorqueColumns, ...]:
    """What the torques of p plates are as they stand in the file.

    Args:
        force, point, torque: (k, p, 3) N, m and N m, in ground axes; where a plate carries little the point may be
            anything.
    """
    loaded = force[..., 1] > FIRM_LOAD_N
    columns, elsewhere = [], exchanged_torques(force[..., 1], torque[..., 1])
    for p in range(force.shape[1]):
        rows = loaded[:, p]
        if rows.sum() < _FEWEST:
            columns.append(TorqueColumns(np.nan, (0.0, 0.0, 0.0), None))
            continue
        own = torque[rows, p]
        moves = float(np.ptp(point[rows, p][:, [0, 2]], axis=0).max()) > _MOVES_M
        arm = float(np.median(np.hypot(own[:, 0], own[:, 2]) / force[rows, p, 1])) if moves else np.nan
        x, y, z = (rms(values) for values in own.T)
        columns.append(TorqueColumns(arm, (x, y, z), elsewhere.get(p)))
    return tuple(columns)


def torque_columns_doubts(plates: PlateLoads) -> list[str]:
    """Plates whose torques are not the free moments at their centres of pressure, by what stood in the file."""
    columns = list(zip(plates.names, plates.torques or (), strict=plates.torques is not None))
    turned = [(name, one) for name, one in columns if _is_turned(one)]
    elsewhere = [(name, one) for name, one in columns if one.arm_m > _LONG_ARM_M and not _is_turned(one)]
    return [*_about_another_point(elsewhere), *_other_axes(turned)]


def _is_turned(columns: TorqueColumns) -> bool:
    """Whether a free moment stands in the column of a horizontal axis."""
    x, y, z = columns.rms_nm
    across = float(np.hypot(x, z))
    return bool(columns.arm_m > 0.0 and _SOME_NM < across < _LARGEST_NM and y < _LITTLE * across)


def _about_another_point(found: list[tuple[str, TorqueColumns]]) -> list[str]:
    if not found:
        return []
    shown = "; ".join(
        f"those of {name} have horizontal parts of {np.hypot(one.rms_nm[0], one.rms_nm[2]):.1f} N m (RMS under load), "
        f"{1e3 * one.arm_m:.0f} mm times the vertical force (median)"
        for name, one in found
    )
    return [
        f"the torques of the force file do not go with the points of application beside them: {shown}; at a centre of "
        "pressure there are none (up to 1 mm are usual): likeliest the torques are moments about another point (the "
        "plate's middle or its sensors), which moves the loads under the feet by so much; export the free moment "
        "(about the vertical through the centre of pressure, horizontal parts zero), or, as points of application, "
        "the points that the torques are about"
    ]


def _other_axes(found: list[tuple[str, TorqueColumns]]) -> list[str]:
    if not found:
        return []
    shown = "; ".join(
        f"those of {name} are {max(one.rms_nm[0], one.rms_nm[2]):.1f} N m along {'Z' if _along_z(one) else 'X'} and "
        f"{one.rms_nm[1]:.1f} along Y (RMS under load)"
        for name, one in found
    )
    return [
        f"the torques of the force file are about a horizontal axis: {shown}; at a centre of pressure they are about "
        "the vertical, Y, and of this size: likeliest the torques were not turned with the forces, and the free moment "
        "stands in the column of another axis; turn torques as forces and points are, and export them again"
    ]


def _along_z(columns: TorqueColumns) -> bool:
    return columns.rms_nm[2] > columns.rms_nm[0]
