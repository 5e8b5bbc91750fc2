"""Finds out what the torque columns of a force file hold: free moments, about the vertical, or something else.

A force file has a point of application beside each torque, and nothing but its maker sees to it that they go together.
At the centre of pressure no torque is horizontal, by definition: in eleven sound force files the median is 0.0 mm times
the vertical force, the 99th percentile at most 10 mm (where forces are smallest). Torques about the middle of the plate
are horizontal, too, by some 20 mm and more. Where the point stays in its place (at the plate's middle, at the origin),
it is no centre of pressure, and force and torque are what acts there: nothing is wrong.
"""

from __future__ import annotations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import FloatArray, TorqueColumns
from kinertia.trial.exchanged_torques import exchanged_torques
from kinertia.trial.rms import rms

_FEWEST = 20
_MOVES_M = 0.02
"""Under a foot that lands and leaves the centre of pressure moves by 0.2 m, in squats by 0.1."""


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
