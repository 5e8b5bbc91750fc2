"""Identifies what the torque columns of a force file hold: free moments about the vertical, or something else.

A force file has a point of application for each torque, and only the program that wrote it ensures that they match. By
definition the torque about the centre of pressure has no horizontal part: in eleven correct force files the median is
0.0 mm times the vertical force, the 99th percentile at most 10 mm (where forces are smallest). Torques about the middle
of the plate do have horizontal parts, of some 20 mm and more. A point that never moves (the plate's middle, the origin)
is not a centre of pressure: force and torque are then what acts at that point, which is no error.

Free moments may also be in another plate's columns: they follow the load of that plate. An unloaded plate has no free
moment. While the other foot alone carries the person, correct force files have at most 0.2 times the free moment that
they have while the plate's own foot does (RMS; filters and amplifiers leave some), files with interchanged columns at
least 5 times. What a file holds for an unloaded plate may also be a ratio of two noise signals, but that is as large
while neither plate is loaded, or jumps from sample to sample. Where both plates are always loaded, nothing is reported.
"""

from itertools import combinations

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray
from kinertia.trial.file_contents import TorqueColumns
from kinertia.trial.rms import rms

_FEWEST = 20
_MOVES_M = 0.02
"""Least movement of a centre of pressure: it moves by 0.2 m under a foot that lands and leaves, by 0.1 m in squats."""


def torque_columns(force: FloatArray, point: FloatArray, torque: FloatArray) -> tuple[TorqueColumns, ...]:
    """Describe the torque columns of p plates as they are in the file.

    Args:
        force, point, torque: (k, p, 3) N, m and N m, in ground axes; where a plate is hardly loaded the point may be
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
        columns.append(TorqueColumns(arm, (x, y, z), elsewhere.get(p), float(np.median(point[rows, p, 1]))))
    return tuple(columns)


_FEWEST_ALONE = 10
_SOME_NM, _LITTLE, _LONGEST_ARM_M = 0.2, 0.5, 0.034
"""Limits: RMS of a free moment; share of it while the plate is unloaded; free moment over vertical force (95th
percentile, m)."""
_JUMPS = 0.7
"""RMS of the changes from sample to sample over that of the values: 1.4 of noise, 0.003 to 0.44 of free moments."""


def exchanged_torques(vertical: FloatArray, torque: FloatArray) -> dict[int, int]:
    """Find plates whose torques follow another plate's vertical force, and vice versa: returns {a: b, b: a}.

    Args:
        vertical, torque: (k, p) N and N m about the vertical, as they are in a file.
    """
    pairs: dict[int, int] = {}
    for a, b in combinations(range(vertical.shape[1]), 2):
        only_a, only_b = (
            (vertical[:, own] > FIRM_LOAD_N) & (vertical[:, other] < LOAD_THRESHOLD_N)
            for own, other in ((a, b), (b, a))
        )
        if min(only_a.sum(), only_b.sum()) < _FEWEST_ALONE:
            continue
        neither = (vertical[:, [a, b]] < LOAD_THRESHOLD_N).all(axis=1)
        if _goes_with(torque[:, a], only_a | neither, only_b, vertical[:, b]) and _goes_with(
            torque[:, b], only_b | neither, only_a, vertical[:, a]
        ):
            pairs |= {a: b, b: a}
    return pairs


def _goes_with(torque: FloatArray, without: BoolArray, other: BoolArray, vertical: FloatArray) -> bool:
    """Decide whether a torque (k,) is near zero in samples `without` and a free moment in samples `other`."""
    torque = np.nan_to_num(torque)
    meanwhile = rms(torque[other])
    return (
        meanwhile > _SOME_NM
        and rms(torque[without]) < _LITTLE * meanwhile
        and rms(np.diff(torque)[other[1:] & other[:-1]]) < _JUMPS * meanwhile
        and float(np.percentile(np.abs(torque[other]) / vertical[other], 95)) < _LONGEST_ARM_M
    )
