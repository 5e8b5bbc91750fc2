"""Finds which axis of a laboratory is up, and the rotation to ground axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import BoolArray, FloatArray
from kinertia.trial.marker_quality import UPRIGHT_SHARE

if TYPE_CHECKING:
    from kinertia.io.lab_plates import LabPlates

_FEWEST_SEEN = 6
_ABOVE_FLOOR_M, _LOWEST_TOP_M, _HIGHEST_TOP_M = 0.2, 0.5, 2.5
_AXES = {sign + "XYZ"[axis]: (axis, -1 if sign == "-" else 1) for axis in range(3) for sign in ("", "+", "-")}


def to_ground(
    path: Path, stated: str, where: str, positions: FloatArray, plates: LabPlates | None
) -> tuple[FloatArray, str, list[Finding]]:
    """Find the rotation from laboratory to ground axes, from the file's statement and from the data.

    Args:
        path: the file, for findings.
        stated: the axis that it states as vertical, such as "+Z"; empty where it states none.
        where: place in the file where it states so, or would.
        positions: (n, m, 3) m, markers in the laboratory's axes; NaN where not seen.
        plates: plates on the floor, if any.

    Returns:
        the rotation (3, 3), the axis that is up, and what was found (F131 to F133).
    """
    stated_up = _AXES.get(stated)
    seen = positions[_seen(positions).any(axis=1)]
    extent = np.median(np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1), axis=0)
    floor = np.zeros(3) if plates is None or plates.corners is None else plates.corners.mean(axis=(0, 1))
    force = np.zeros(3) if plates is None else plates.loaded_direction()
    if np.abs(force).max() > 0.8:
        axis, source = int(np.argmax(np.abs(force))), "forces of the plates"
    else:
        axis, source = int(np.argmax(extent)), "extents of the markers"
        if stated_up is not None and extent[stated_up[0]] > 0.5 * extent[axis]:
            axis = stated_up[0]
    middle = np.nanmedian(seen, axis=(0, 1))[axis] - floor[axis]
    data_up = (axis, 1 if middle >= 0 else -1)
    up = f"{'+-'[data_up[1] < 0]}{'XYZ'[axis]}"
    found, place = {"axis": Quantity(up), "source": Quantity(source), "entry": Quantity(where)}, Where(path.name)
    findings = []
    if stated_up is None:
        findings.append(with_evidence("F131", place, found))
    elif stated_up != data_up:
        findings.append(with_evidence("F132", place, {"stated": Quantity(stated), **found}))
    if up != "+Y":
        findings.append(finding("F133", place, axis=Quantity(up)))
    return _rotation(*data_up), up, findings


def upright_along_z(positions: FloatArray, standing: bool = False) -> FloatArray | None:
    """Return the rotation (3, 3) to ground axes where a person stands upright on the floor z = 0; None if uncertain.

    For files that cannot state which axis is up. In half of the frames or more, markers reach from the floor to above a
    child's hip along Z, and much less far along Y, or, with arms stretched out along Y, not from the floor.

    Args:
        positions: (n, m, 3) m in the laboratory's axes; NaN where not seen.
        standing: whether the person is known to stand: on whatever height, then.
    """
    seen = positions[_seen(positions).sum(axis=1) >= _FEWEST_SEEN]
    if not len(seen):
        return None
    low, high = (np.median(reach(seen, axis=1), axis=0) for reach in (np.nanmin, np.nanmax))
    extent = high - low
    on_floor = (np.abs(low) < _ABOVE_FLOOR_M) & (high > _LOWEST_TOP_M) & (high < _HIGHEST_TOP_M)
    slender = extent[2] == extent.max() and extent[1] < UPRIGHT_SHARE * extent[2]
    arms_out = extent[2] >= UPRIGHT_SHARE * extent.max() and not on_floor[1]
    upright = (slender and standing) or (on_floor[2] and (slender or arms_out))
    return _rotation(2, 1) if upright else None


def rotation_of_line(upwards: FloatArray) -> tuple[FloatArray, str]:
    """Return the rotation (3, 3) that brings the axis nearest to a line from feet to pelvis (3,) up, and its name."""
    axis = int(np.argmax(np.abs(upwards)))
    sign = 1 if upwards[axis] > 0 else -1
    return _rotation(axis, sign), f"{'+-'[sign < 0]}{'XYZ'[axis]}"


def ground_rotation(vertical: str) -> FloatArray:
    """Return the rotation (3, 3) to ground axes from axes with this one up, such as "+Z"."""
    return _rotation(*_AXES[vertical])


def _seen(positions: FloatArray) -> BoolArray:
    """Return (n, m) True where all three coordinates are present."""
    return np.asarray(np.isfinite(positions).all(axis=2))


def _rotation(axis: int, sign: int) -> FloatArray:
    """Return the rotation (3, 3) of a lab axis to +Y that keeps lab X if it can; for Z up (x, y, z) -> (x, z, -y)."""
    up = np.zeros(3)
    up[axis] = sign
    forward = np.eye(3)[1 if axis == 0 else 0]
    return np.array([forward, up, np.cross(forward, up)])
