"""Force plates of a C3D file, from what ezc3d gives to loads about the ground origin.

ezc3d gives each plate's force in lab axes and, for types 2 to 4, its moment about the middle of the plate's
four corners, also in lab axes, in units made of POINT:UNITS. For type 1 the file holds the centre of pressure
and the free moment; ezc3d's moment has the opposite sign there, so the moment is made from those two.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError
from kinertia.io.trc import METRES_PER_UNIT
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads
from kinertia.trial.idle_plate import without_idle

_CORNER_LIMIT_M = 50.0
_EDGE_LIMITS_M = (0.1, 10.0)
_OUTSIDE_LIMIT_M = 0.05
_OFFSET_LIMIT_N = 5.0
_FEWEST_IDLE_SAMPLES = 50


@dataclass(frozen=True, eq=False)
class LabPlates:
    """The p readable plates in lab axes, SI.

    Attributes:
        names: (p) `plate 1`, ... by the file's order.
        force: (k, p, 3) N as in the file, on the person or on the plate.
        moment: (k, p, 3) N m about the lab origin.
        corners: (p, 4, 3) m, or None where the file does not tell.
    """

    names: tuple[str, ...]
    force: FloatArray
    moment: FloatArray
    corners: FloatArray | None

    def loaded_direction(self) -> FloatArray:
        """Mean direction (3,) of the loaded samples, each without its sign; zero when nothing is loaded."""
        size = np.linalg.norm(self.force, axis=2)
        loaded = self.force[size > 5 * LOAD_THRESHOLD_N]
        if len(loaded) < 10:
            return np.zeros(3)
        axis = int(np.argmax(np.abs(loaded).sum(axis=0)))
        mean = (loaded * np.sign(loaded[:, axis, None])).mean(axis=0)
        result: FloatArray = mean / np.linalg.norm(mean)
        return result


def lab_plates(path: Path, file: Any, length_unit: str) -> tuple[LabPlates | None, list[str]]:
    """The plates that can be used, in lab axes; None where there is none. `length_unit` is the file's: mm, cm or m."""
    unit = METRES_PER_UNIT[length_unit]
    platforms = file["data"].get("platform", [])
    group = file["parameters"].get("FORCE_PLATFORM", {})
    names, forces, moments, corners, notes = [], [], [], [], []
    for number, platform in enumerate(platforms, start=1):
        name = f"plate {number}"
        places = unit * platform["corners"].T
        trouble = _corner_trouble(places) or _unit_trouble(file, group, number - 1, length_unit)
        trouble = trouble or ("" if platform["force"].size else "it has no samples")
        if trouble:
            notes.append(f"{path.name}: {name} was left out, {trouble}")
            continue
        force = platform["force"].T
        if int(group["TYPE"]["value"][number - 1]) == 1:
            moment = np.cross(unit * platform["center_of_pressure"].T, force) + unit * platform["Tz"].T
        else:
            moment = unit * platform["moment"].T + np.cross(places.mean(axis=0), force)
        names.append(name)
        forces.append(force)
        moments.append(moment)
        corners.append(places)
    if not names:
        return None, notes
    return LabPlates(tuple(names), np.stack(forces, axis=1), np.stack(moments, axis=1), np.array(corners)), notes


def to_ground_plates(
    path: Path, plates: LabPlates | None, rotation: FloatArray, time: FloatArray
) -> tuple[PlateLoads | None, list[str]]:
    """Loads on the person in ground axes, zero where nobody stands on a plate."""
    if plates is None:
        return None, [f"{path.name}: no force plate that can be used"]
    force, moment = plates.force @ rotation.T, plates.moment @ rotation.T
    corners = None if plates.corners is None else plates.corners @ rotation.T
    notes, noises, idle = [], [], []
    for p, name in enumerate(plates.names):
        vertical = np.nan_to_num(force[:, p, 1])
        if vertical[np.argmax(np.abs(vertical))] < -LOAD_THRESHOLD_N:
            force[:, p] *= -1
            moment[:, p] *= -1
            notes.append(
                f"{path.name}: {name} reports a force that points down, the load on the plate; it was reversed"
            )
        loaded = force[:, p, 1] >= LOAD_THRESHOLD_N
        lost = np.isnan(force[:, p]).any(axis=1) | (loaded & np.isnan(moment[:, p]).any(axis=1))
        if lost.any():
            raise FileError(path, f"{name} has no number at {time[lost][0]:g} s; expected one for every sample")
        offset = np.median(force[~loaded, p], axis=0) if (~loaded).sum() >= _FEWEST_IDLE_SAMPLES else np.zeros(3)
        if np.linalg.norm(offset) > _OFFSET_LIMIT_N:
            reading = ", ".join(f"{value:.0f}" for value in offset)
            notes.append(f"{path.name}: {name} reads ({reading}) N when unloaded; this was not subtracted")
        plate = without_idle(time, force[:, p], np.nan_to_num(moment[:, p]))
        force[:, p], moment[:, p] = plate.force, plate.moment
        noises.append(plate.noise_n)
        idle.append(plate.idle)
        if not loaded.any():
            notes.append(f"{path.name}: {name} never reaches {LOAD_THRESHOLD_N:g} N")
        elif (
            corners is not None
            and (outside := _outside(force[loaded, p], moment[loaded, p], corners[p])) > _OUTSIDE_LIMIT_M
        ):
            notes.append(
                f"{path.name}: the centre of pressure of {name} lies {100 * outside:.0f} cm outside its "
                "corners; check the plate's corners, origin and units"
            )
    loads = PlateLoads(
        time, plates.names, force, moment, (None,) * len(plates.names), corners, tuple(noises), tuple(idle)
    )
    return loads, notes


def _corner_trouble(corners: FloatArray) -> str:
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    low, high = _EDGE_LIMITS_M
    if (
        np.isfinite(corners).all()
        and np.abs(corners).max() < _CORNER_LIMIT_M
        and low < edges.min()
        and edges.max() < high
    ):
        return ""
    return f"its corners do not form a plate (edges of {', '.join(f'{edge:.3g}' for edge in edges)} m)"


def _unit_trouble(file: Any, group: Any, plate: int, length: str) -> str:
    """Moments are taken to be in N times the file's unit of `length`; say where the analog channels say otherwise."""
    if int(group["TYPE"]["value"][plate]) not in (2, 4):
        return ""
    channels = np.atleast_2d(group["CHANNEL"]["value"])[:, plate]
    units = file["parameters"]["ANALOG"]["UNITS"]["value"]
    channel = int(channels[3]) - 1
    unit = units[channel] if channel < len(units) else ""
    said = "".join(letter for letter in str(unit).lower() if letter.isalpha())
    if said in ("nm", "nmm", "ncm") and said != "n" + length:
        return f"its moments are in {unit} while points are in {length}"
    return ""


def _outside(force: FloatArray, moment: FloatArray, corners: FloatArray) -> float:
    """How far (m) the load-weighted mean centre of pressure lies outside the box around the corners."""
    total = force[:, 1].sum()
    height = corners[:, 1].mean()
    x = (moment[:, 2].sum() + height * force[:, 0].sum()) / total
    z = (height * force[:, 2].sum() - moment[:, 0].sum()) / total
    low, high = corners[:, [0, 2]].min(axis=0), corners[:, [0, 2]].max(axis=0)
    place = np.array([x, z])
    return float(np.max(np.maximum(low - place, place - high)))
