"""Reads force files of Cortex (Motion Analysis): `walk.forces` beside `walk.trc`.

A text file: `[Force Data]`, `NumberOfForcePlates=2`, `SampleRate=1200.000000`, `NumberOfSamples=6000`, a line of
columns `#Sample FX1 FY1 FZ1 X1 Y1 Z1 MZ1 FX2 ...`, and a row per sample. Each plate has force (N), centre of pressure
(mm) and free moment, in the laboratory's axes, like the markers. The file does not contain the corners of the plates.
Sample 1 is at time zero.
"""

import re
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, mismatch
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.lab_plates import LabPlates, to_ground_plates
from kinertia.io.text.number_table import read_lines, read_rows, uneven
from kinertia.io.text.sto import header_entry, other_count
from kinertia.trial.data import LOAD_THRESHOLD_N, FloatArray, PlateLoads

_TITLE, _COLUMNS = "[Force Data]", "#Sample"
_OF_A_PLATE = ("FX", "FY", "FZ", "X", "Y", "Z", "MZ")
_MM = 1e-3
_LONGEST_ARM_M = 0.1
"""Largest ratio of free moment to vertical force. Feet reach some millimetres: larger ones are in N mm."""
_FASTEST_HZ = 1e6


def read_cortex_forces(path: str | Path, turn: FloatArray | None = None) -> tuple[PlateLoads, tuple[Finding, ...]]:
    """Read force plates from a `.forces` file: loads on the person about the ground origin, N and N m.

    Args:
        path: the file.
        turn: rotation (3, 3) from the laboratory's axes to ground axes, where these differ.

    Returns:
        the plates, whose corners are unknown, and what was found.

    Raises:
        FileError: the file is missing, broken, or lacks columns; samples are missing; or its forces are vertical along
            another axis than the markers.
    """
    path, turn = Path(path), np.eye(3) if turn is None else turn
    lines = read_lines(path)
    header, columns, first_row = _header(path, lines)
    rate_hz = _number(path, header, "SampleRate")
    plates = _plate_numbers(path, columns)
    values, _ = read_rows(path, lines, first_row, len(columns), may_be_short=True)
    findings = [
        other_count(path, None, stated, count, what)
        for key, count, what in (
            ("NumberOfForcePlates", len(plates), "plates"),
            ("NumberOfSamples", len(values), "rows"),
        )
        if key in header and (stated := _number(path, header, key)) != count
    ]
    time = _times(path, values[:, 0] if len(values) else np.zeros(0), rate_hz, first_row)
    vertical = int(np.argmax(np.abs(turn[1])))
    names, forces, moments = [], [], []
    for number in plates:
        at = [columns.index(f"{name}{number}") for name in _OF_A_PLATE]
        names.append(f"plate {number}")
        force, point, free = values[:, at[:3]], _MM * values[:, at[3:6]], values[:, at[6]]
        unit, found = _moment_unit(path, names[-1], force[:, vertical], free)
        findings += found
        forces.append(force)
        moments.append(np.cross(point, force) + unit * free[:, None] * np.eye(3)[vertical])
    lab = LabPlates(tuple(names), np.stack(forces, axis=1), np.stack(moments, axis=1), None)
    _expect_vertical(path, lab, vertical)
    loads, load_findings = to_ground_plates(path, lab, turn, time)
    assert loads is not None
    return loads, (*findings, *load_findings)


def _header(path: Path, lines: list[str]) -> tuple[dict[str, str], list[str], int]:
    """Read the header entries, the columns, and the one-based line at which the rows begin."""
    if lines[0].strip() != _TITLE:
        raise mismatch(path, "a force file of Cortex", f"'{lines[0].strip()[:40]}'", f"'{_TITLE}'", 1)
    entries: dict[str, str] = {}
    for number, line in enumerate(lines[1:], start=2):
        if line.startswith(_COLUMNS):
            return entries, line.split(), number + 1
        key, _, value = line.partition("=")
        entries[key.strip()] = value.strip()
    raise mismatch(path, "a force file of Cortex", f"no line '{_COLUMNS}'", "one with the names of the columns")


def _number(path: Path, header: dict[str, str], key: str) -> float:
    text = header.get(key, "")
    number = float(text) if re.fullmatch(r"\d+(\.\d*)?(e[+-]?\d+)?", text, re.IGNORECASE) else 0.0
    if not 0.0 < number < _FASTEST_HZ:
        raise header_entry(path, None, key, f"'{text}'" if key in header else "missing", "a number above zero")
    return number


def _plate_numbers(path: Path, columns: list[str]) -> list[str]:
    """Return the suffix of the column names of each plate: "1", "2"."""
    numbers = list(dict.fromkeys(name[2:] for name in columns if re.fullmatch(r"FX\d+", name)))
    for number in numbers or ["1"]:
        lacking = [f"{name}{number}" for name in _OF_A_PLATE if f"{name}{number}" not in columns]
        if lacking:
            missing = Quantity(f"the columns {', '.join(lacking)}")
            raise FileError.found(path, "F156", None, Where(plate=f"plate {number}"), columns=missing)
    return numbers


def _times(path: Path, samples: FloatArray, rate_hz: float, first_line: int) -> FloatArray:
    """Return times (k,) s of samples whose numbers count up by one."""
    if not len(samples):
        raise FileError.found(path, "F104", rows=Quantity(0, "1"), found=Quantity("no rows follow the column labels"))
    odd = np.flatnonzero(~(np.diff(samples) == 1.0))
    time: FloatArray = (samples - 1.0) / rate_hz
    if odd.size:
        row = int(odd[0]) + 1
        raise uneven(path, first_line + row, time[row - 1], time[row], 1.0 / rate_hz)
    return time


def _moment_unit(path: Path, plate: str, vertical: FloatArray, free: FloatArray) -> tuple[float, list[Finding]]:
    """Return how many N m the unit of the free moment is (N m or N mm), which the file does not state (F152)."""
    loaded = np.abs(vertical) > LOAD_THRESHOLD_N
    lever_arm_m = float(np.median(np.abs(free[loaded] / vertical[loaded]))) if loaded.any() else 0.0
    if lever_arm_m <= _LONGEST_ARM_M:
        return 1.0, []
    found = {"lever_arm_m": Quantity(lever_arm_m, "m", limit=_LONGEST_ARM_M), "unit": Quantity("N mm")}
    return _MM, [with_evidence("F152", Where(path.name, plate=plate), found)]


def _expect_vertical(path: Path, plates: LabPlates, vertical: int) -> None:
    """Raise FileError P201 where the forces on all plates are vertical along another axis than the markers."""
    direction = plates.loaded_direction()
    axis = int(np.argmax(np.abs(direction)))
    if np.abs(direction).any() and axis != vertical:
        peaks = tuple(map(float, np.nanmax(np.abs(plates.force), axis=(0, 1))))
        known = {"axis": Quantity("XYZ"[axis]), "vertical": Quantity("XYZ"[vertical])}
        raise FileError.found(
            path, "P201", None, Where(plate=plates.names[0]), peak_n=Quantity(peaks, "N"), **known,
            column=Quantity(f"F{'XYZ'[axis]}{plates.names[0].split()[-1]}"),
        )  # fmt: skip
