"""Force plates of a C3D file, from what ezc3d gives to loads about the ground origin.

ezc3d gives each plate's force in lab axes and, for types 2 to 4, its moment about the middle of the plate's
four corners, also in lab axes, in units made of POINT:UNITS. For type 1 the file holds the centre of pressure
and the free moment; ezc3d's moment has the opposite sign there, so the moment is made from those two.
"""

from __future__ import annotations

from collections.abc import Sequence
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
_MUCH_NEARER = 0.5


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


def lab_plates(path: Path, file: Any, length_unit: str) -> tuple[LabPlates | None, list[str], list[str]]:
    """The plates that can be used, in lab axes; None where there is none. `length_unit` is the file's: mm, cm or m.

    Also why others were left out, and notes.
    """
    unit = METRES_PER_UNIT[length_unit]
    platforms = file["data"].get("platform", [])
    group = file["parameters"].get("FORCE_PLATFORM", {})
    names, forces, moments, corners, left_out, notes = [], [], [], [], [], []
    for number, platform in enumerate(platforms, start=1):
        name = f"plate {number}"
        places = unit * platform["corners"].T
        kind = int(group["TYPE"]["value"][number - 1])
        stated, moment_unit = _moment_unit(file, group, number - 1, length_unit)
        trouble = _corner_trouble(places) or ("" if platform["force"].size else "it has no samples")
        if moment_unit != unit and kind == 4:  # nobody knows what its matrix makes of them
            trouble = trouble or f"its moments are in {stated} while points are in {length_unit}"
        if trouble:
            left_out.append(f"{name} was left out, {trouble}")
            continue
        if moment_unit != unit:
            notes.append(f"{path.name}: the moments of {name} are in {stated}, points in {length_unit}: converted")
        names.append(name)
        forces.append(platform["force"].T)
        moments.append(_moment(platform, kind, unit, moment_unit))
        corners.append(places)
    if not names:
        return None, left_out, notes
    plates = LabPlates(tuple(names), np.stack(forces, axis=1), np.stack(moments, axis=1), np.array(corners))
    return plates, left_out, notes


def _moment(platform: Any, kind: int, unit: float, moment_unit: float) -> FloatArray:
    """(k, 3) N m about the lab origin, of a file whose lengths are in `unit` (m), and moments in N `moment_unit`."""
    force, corners = platform["force"].T, platform["corners"].T
    if kind == 1:
        result: FloatArray = np.cross(unit * platform["center_of_pressure"].T, force) + unit * platform["Tz"].T
        return result
    # to what the channels say ezc3d adds that of the way from the transducer to the surface, in the unit of lengths
    measured = platform["moment"].T - np.cross(force, _axes(corners) @ platform["origin"])
    about_middle = unit * platform["moment"].T + (moment_unit - unit) * measured
    result = about_middle + np.cross(unit * corners.mean(axis=0), force)
    return result


def _axes(corners: FloatArray) -> FloatArray:
    """Columns (3, 3): a plate's axes in the laboratory, by its corners (4, 3), as ezc3d has them."""
    x, along = corners[0] - corners[1], corners[0] - corners[3]
    z = np.cross(x, along)
    return np.column_stack([axis / np.linalg.norm(axis) for axis in (x, np.cross(z, x), z)])


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


def person_on_plates(platforms: Any, people: Sequence[str], labels: Sequence[str], positions: FloatArray) -> str:
    """Of several people the one who is much nearer to the plates while they are loaded; empty where nobody is.

    Args:
        platforms: as ezc3d has them.
        people: what their labels begin with.
        labels: of all m markers.
        positions: (n, m, 3) in the axes and unit of the file.
    """
    if len(people) < 2:
        return ""
    away: dict[str, list[FloatArray]] = {person: [] for person in people}
    for platform in platforms:
        force = platform["force"].T[:: max(1, platform["force"].shape[1] // len(positions))][: len(positions)]
        loaded = np.flatnonzero(np.linalg.norm(force, axis=1) > 5 * LOAD_THRESHOLD_N)
        distance = np.linalg.norm(positions[loaded] - platform["corners"].mean(axis=1), axis=2)
        for person in people:
            own = [label.startswith(f"{person}:") for label in labels]
            away[person].append(np.nan_to_num(distance[:, own], nan=np.inf).min(axis=1))
    far = {person: float(np.median(np.concatenate(rows))) for person, rows in away.items() if any(map(len, rows))}
    nearest, *others = sorted(far, key=lambda person: far[person]) or [""]
    return nearest if others and far[nearest] < _MUCH_NEARER * far[others[0]] else ""


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


def _moment_unit(file: Any, group: Any, plate: int, length: str) -> tuple[str, float]:
    """What the analog channels of a plate say its moments are in, and how many N m that is; N `length` by default."""
    if int(group["TYPE"]["value"][plate]) not in (2, 4):
        return "", METRES_PER_UNIT[length]
    channels = np.atleast_2d(group["CHANNEL"]["value"])[:, plate]
    units = file["parameters"]["ANALOG"]["UNITS"]["value"]
    channel = int(channels[3]) - 1
    unit = str(units[channel]) if channel < len(units) else ""
    said = "".join(letter for letter in unit.lower() if letter.isalpha())
    return unit, METRES_PER_UNIT[said[1:] if said in ("nm", "nmm", "ncm") else length]


def _outside(force: FloatArray, moment: FloatArray, corners: FloatArray) -> float:
    """How far (m) the load-weighted mean centre of pressure lies outside the box around the corners."""
    total = force[:, 1].sum()
    height = corners[:, 1].mean()
    x = (moment[:, 2].sum() + height * force[:, 0].sum()) / total
    z = (height * force[:, 2].sum() - moment[:, 0].sum()) / total
    low, high = corners[:, [0, 2]].min(axis=0), corners[:, [0, 2]].max(axis=0)
    place = np.array([x, z])
    return float(np.max(np.maximum(low - place, place - high)))
