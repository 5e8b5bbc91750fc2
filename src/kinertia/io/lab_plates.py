"""Holds force plates in a laboratory's axes, as files have them, and turns them to loads in ground axes.

Files do not state the reference point of their moments: the middle of the plate, of its surface, or the origin. But the
force has no horizontal moment about the centre of pressure. So the point c is the one for which

    M - (p - c) x F

has none, by least squares over the loaded samples; the rest is the free moment.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.force_spikes import without_spikes
from kinertia.trial.impossible_data import impossible_load
from kinertia.trial.plate_loading import joined, largest_n, without_unloaded_level

MOMENTS_FIT = 0.05
"""Moments agree with the centre of pressure if they miss it by no more than this share (RMS)."""
_FEWEST = 10


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
