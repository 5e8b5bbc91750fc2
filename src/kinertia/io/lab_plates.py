"""Holds force plates in a laboratory's axes, as files have them, and turns them to loads in ground axes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.plate_moments import MOMENTS_FIT
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.force_spikes import without_spikes
from kinertia.trial.impossible_data import impossible_load
from kinertia.trial.plate_loading import joined, largest_n, without_unloaded_level


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
