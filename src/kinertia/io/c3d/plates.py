"""Reads force plates of a C3D file: converts ezc3d's output to loads about the ground origin.

ezc3d gives each plate's force in lab axes and, for types 2 to 4, its moment about the middle of the plate's
four corners, also in lab axes, in units made of POINT:UNITS. For type 1 the file holds the centre of pressure
and the free moment; ezc3d's moment has the opposite sign there, so the moment is made from those two.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.c3d.ezc3d_library import parameter_values
from kinertia.io.lab_plates import LabPlates, plate_left_out
from kinertia.io.text.trc import METRES_PER_UNIT
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray

PLATE_TYPES = (1, 2, 3, 4)
"""Those that ezc3d reads."""
_MOMENT_UNIT = re.compile("n(?:ewtons?)?(milli|centi|m(?=m)|c)?m(?:et(?:er|re)s?)?")
"""Letters of N m, N mm and N cm, as symbols or words."""
_CORNER_LIMIT_M = 50.0
_EDGE_LIMITS_M = (0.1, 10.0)
_MUCH_NEARER = 0.5


def lab_plates(path: Path, file: Any, length_unit: str) -> tuple[LabPlates | None, list[Finding]]:
    """Return the usable plates in lab axes (None without any) and findings; `length_unit` is the file's: mm, cm or m.

    The findings are plates that were left out (F151) and units that were converted (F152).
    """
    unit = METRES_PER_UNIT[length_unit]
    platforms = file["data"].get("platform", [])
    kinds = [int(kind) for kind in parameter_values(file["parameters"], "FORCE_PLATFORM", "TYPE")]
    names, forces, moments, corners = [], [], [], []
    findings: list[Finding] = []
    for number, platform in enumerate(platforms, start=1):
        name = f"plate {number}"
        places = unit * platform["corners"].T
        kind = kinds[number - 1]
        stated, moment_unit = _moment_unit(file["parameters"], kind, number - 1, len(platforms), length_unit)
        reason, edges = _corner_trouble(places)
        if not platform["force"].size:
            reason = reason or "it has no samples"
        if not reason and moment_unit != unit and kind == 4:
            of_matrix = _unit_of_matrix(platform, unit, moment_unit)
            reason = "" if of_matrix else f"its moments are in {stated} while points are in {length_unit}"
            moment_unit = of_matrix or moment_unit
        if reason:
            findings.append(plate_left_out(path, name, reason, **edges))
            continue
        if moment_unit != unit:
            units = {"unit": Quantity(stated), "length_unit": Quantity(length_unit)}
            findings.append(with_evidence("F152", Where(path.name, plate=name), units))
        names.append(name)
        forces.append(platform["force"].T)
        moments.append(_moment(platform, kind, unit, moment_unit))
        corners.append(places)
    if not names:
        return None, findings
    plates = LabPlates(tuple(names), np.stack(forces, axis=1), np.stack(moments, axis=1), np.array(corners))
    return plates, findings


def _moment(platform: Any, kind: int, unit: float, moment_unit: float) -> FloatArray:
    """Return moments (k, 3) N m about the lab origin; the file has lengths in `unit` (m), moments N `moment_unit`."""
    force, corners = platform["force"].T, platform["corners"].T
    if kind == 1:
        result: FloatArray = np.cross(unit * platform["center_of_pressure"].T, force) + moment_unit * platform["Tz"].T
        return result
    # ezc3d adds to the channels' moments the force times the offset from transducer to surface, in the unit of lengths
    measured = platform["moment"].T - np.cross(force, plate_axes(corners) @ platform["origin"])
    about_middle = unit * platform["moment"].T + (moment_unit - unit) * measured
    result = about_middle + np.cross(unit * corners.mean(axis=0), force)
    return result


def _unit_of_matrix(platform: Any, unit: float, stated: float) -> float | None:
    """Return the unit (N m) of a type 4 plate's moments after its calibration matrix, or None if it stays unknown.

    It is either the `stated` unit or newtons times the `unit` of lengths. The larger one that puts the mean centre of
    pressure under load on the plate is chosen: with too small a unit, it is always near the middle.
    """
    corners, force = unit * platform["corners"].T, platform["force"].T
    loaded = np.linalg.norm(force, axis=1) > 5 * LOAD_THRESHOLD_N
    axes, half = plate_axes(corners), np.linalg.norm(corners[[0, 0]] - corners[[1, 3]], axis=1) / 2
    for candidate in sorted((unit, stated), reverse=True):
        about_middle = _moment(platform, 4, unit, candidate) - np.cross(corners.mean(axis=0), force)
        load, moment = force[loaded].sum(axis=0) @ axes, about_middle[loaded].sum(axis=0) @ axes
        if (np.abs([moment[1], moment[0]]) <= half * np.abs(load[2])).all():
            return candidate
    return None


def plate_axes(corners: FloatArray) -> FloatArray:
    """Return a plate's axes in the laboratory as columns (3, 3), from its corners (4, 3), as ezc3d does."""
    x, along = corners[0] - corners[1], corners[0] - corners[3]
    z = np.cross(x, along)
    return np.column_stack([axis / np.linalg.norm(axis) for axis in (x, np.cross(z, x), z)])


def person_on_plates(platforms: Any, people: Sequence[str], labels: Sequence[str], positions: FloatArray) -> str:
    """Return the one of several people who is much nearer to the plates while they are loaded; empty if there is none.

    Args:
        platforms: plates as ezc3d has them.
        people: prefixes of their labels.
        labels: labels of all m markers.
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
            of_person = [label.startswith(f"{person}:") for label in labels]
            away[person].append(np.nan_to_num(distance[:, of_person], nan=np.inf).min(axis=1))
    far = {person: float(np.median(np.concatenate(rows))) for person, rows in away.items() if any(map(len, rows))}
    nearest, *others = sorted(far, key=lambda person: far[person]) or [""]
    return nearest if others and far[nearest] < _MUCH_NEARER * far[others[0]] else ""


def _corner_trouble(corners: FloatArray) -> tuple[str, dict[str, Quantity]]:
    """Return why corners (4, 3) m cannot belong to a plate, and the lengths of the edges; nothing where they can."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    low, high = _EDGE_LIMITS_M
    if (
        np.isfinite(corners).all()
        and np.abs(corners).max() < _CORNER_LIMIT_M
        and low < edges.min()
        and edges.max() < high
    ):
        return "", {}
    return (
        f"its corners do not form a plate (edges of {', '.join(f'{edge:.3g}' for edge in edges)} m)",
        {"edges_m": Quantity(tuple(map(float, edges)), "m")},
    )


def _moment_unit(parameters: Any, kind: int, plate: int, plates: int, length: str) -> tuple[str, float]:
    """Return the moment unit stated by a plate's analog channels, and how many N m it is; N `length` by default."""
    if kind == 3:
        return "", METRES_PER_UNIT[length]
    channels = np.reshape(parameter_values(parameters, "FORCE_PLATFORM", "CHANNEL"), (plates, -1))[plate]
    units = parameter_values(parameters, "ANALOG", "UNITS")
    channel = int(channels[5]) - 1
    unit = str(units[channel]) if channel < len(units) else ""
    said = "".join(letter for letter in unit.lower() if letter.isalpha())
    known = _MOMENT_UNIT.fullmatch(said)
    return unit, METRES_PER_UNIT[f"{(known[1] or '')[:1]}m" if known else length]
