"""Holds force plates in the axes of a laboratory, finds which axis is up, and turns all to ground axes.

Files do not state the reference point of their moments: the middle of the plate, of its surface, or the origin. But the
force has no horizontal moment about the centre of pressure. So the point c is the one for which

    M - (p - c) x F

has none, by least squares over the loaded samples; the rest is the free moment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.marker_quality import UPRIGHT_SHARE
from kinertia.trial.plate_loading import joined, largest_n, without_unloaded_level
from kinertia.trial.plate_signals import without_spikes
from kinertia.trial.sampled_data import impossible_load

MOMENTS_FIT = 0.05
"""Moments agree with the centre of pressure if they miss it by no more than this share (RMS)."""
_FEWEST = 10
_FEWEST_SEEN = 6
_ABOVE_FLOOR_M, _LOWEST_TOP_M, _HIGHEST_TOP_M = 0.2, 0.5, 2.5
_AXES = {sign + "XYZ"[axis]: (axis, -1 if sign == "-" else 1) for axis in range(3) for sign in ("", "+", "-")}


@dataclass(frozen=True, eq=False)
class LabPlates:
    """Readable force plates (p) of a file in lab axes, SI.

    Attributes:
        names: (p) `plate 1`, ... by the file's order.
        force: (k, p, 3) N as in the file, on the person or on the plate.
        moment: (k, p, 3) N m about the lab origin.
        corners: (p, 4, 3) m, or None where the file does not state them.
    """

    names: tuple[str, ...]
    force: FloatArray
    moment: FloatArray
    corners: FloatArray | None

    def loaded_direction(self) -> FloatArray:
        """Return the mean direction (3,) of the loaded samples, each without its sign; zero when nothing is loaded."""
        size = np.linalg.norm(self.force, axis=2)
        loaded = self.force[size > 5 * LOAD_THRESHOLD_N]
        if len(loaded) < 10:
            return np.zeros(3)
        axis = int(np.argmax(np.abs(loaded).sum(axis=0)))
        mean = (loaded * np.sign(loaded[:, axis, None])).mean(axis=0)
        result: FloatArray = mean / np.linalg.norm(mean)
        return result


def to_ground_plates(
    path: Path, plates: LabPlates | None, rotation: FloatArray, time: FloatArray
) -> tuple[PlateLoads | None, list[Finding]]:
    """Return loads on the person in ground axes, zero for unloaded plates."""
    if plates is None:
        return None, []
    force, moment = plates.force @ rotation.T, plates.moment @ rotation.T
    corners = None if plates.corners is None else plates.corners @ rotation.T
    findings, read = [], []
    for p, name in enumerate(plates.names):
        where = Where(path.name, plate=name)
        own_force, own_moment, spikes = without_spikes(time, force[:, p], moment[:, p])
        largest = largest_n(time, np.nan_to_num(own_force))
        if largest < -LOAD_THRESHOLD_N:
            own_force, own_moment = -own_force, -own_moment
            findings.append(finding("F157", where, force_n=Quantity(largest, "N")))
        plate = without_unloaded_level(time, np.nan_to_num(own_force), np.nan_to_num(own_moment))
        loaded = plate.force[:, 1] >= LOAD_THRESHOLD_N
        lost = np.isnan(own_force).any(axis=1) | (loaded & np.isnan(own_moment).any(axis=1))
        if lost.any():
            raise FileError.of(path, impossible_load(name, "force or moment", float(time[lost][0])))
        read.append(plate._replace(spikes=spikes))
    loads = replace(joined(time, plates.names, (None,) * len(plates.names), read), corners=corners)
    return loads, findings


def plate_left_out(path: Path, plate: str | None, reason: str, **evidence: Quantity) -> Finding:
    """Return F151: a plate, or all of them, cannot be used."""
    return with_evidence("F151", Where(path.name, plate=plate), {**evidence, "reason": Quantity(reason)})


def contradicting_moments(path: Path, plate: str, misses: float) -> Finding:
    """Return F153: moments contradict the centre of pressure by this share; the latter was used without a free
    moment."""
    return finding("F153", Where(path.name, plate=plate), misses=Quantity(misses, "1", limit=MOMENTS_FIT))


class PlateMoments(NamedTuple):
    """Moments of one plate about the laboratory's origin.

    Attributes:
        about_origin: (k, 3) N m; without a free moment where moments and centre of pressure contradict each other.
        mismatch: share of the horizontal moments by which they do; infinite while the plate is unloaded.
    """

    about_origin: FloatArray
    mismatch: float

    @property
    def agree(self) -> bool:
        """Whether moments and centre of pressure agree."""
        return self.mismatch <= MOMENTS_FIT

    @classmethod
    def of(cls, force: FloatArray, moment: FloatArray, point: FloatArray) -> Self:
        """Compute from force (k, 3) N, moment (k, 3) N m about an unknown point, and centre of pressure (k, 3) m."""
        at = np.cross(np.nan_to_num(point), force)
        with np.errstate(over="ignore"):
            known = np.isfinite(np.square(np.hstack([point, force, moment, at]))).all(axis=1)
        loaded = known & (np.abs(force[:, 2]) > LOAD_THRESHOLD_N)
        if loaded.sum() < _FEWEST:
            return cls(at, float("inf"))
        rest, f = moment[loaded] - at[loaded], force[loaded]
        zero = np.zeros(len(f))
        # rows of -c x F, horizontal axes
        rows = -np.concatenate(
            [np.stack([zero, f[:, 2], -f[:, 1]], axis=1), np.stack([-f[:, 2], zero, f[:, 0]], axis=1)]
        )
        centre = np.linalg.lstsq(rows, rest[:, :2].T.ravel(), rcond=None)[0]
        left = moment - at + np.cross(centre, force)
        size = moment[loaded, :2] - moment[loaded, :2].mean(axis=0)
        mismatch = float(np.sqrt(np.square(left[loaded, :2]).sum() / max(np.square(size).sum(), 1e-12)))
        if mismatch <= MOMENTS_FIT:
            at[:, 2] += left[:, 2]
        return cls(at, mismatch)


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
