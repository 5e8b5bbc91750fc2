"""Reads CSV and TXT files that Vicon Nexus exports as ASCII: sections of trajectories and devices.

A section has a line with its name, one with its rate, one with what the columns belong to, one with the columns' names,
one with units, and then a row per frame or, of devices, per sub frame. A force plate is three groups of a device: `...
- Force`, `... - Moment` and `... - CoP`. Nexus writes centres of pressure in the laboratory's axes, and forces in the
same axes or in the plate's, depending on which agree (`PlateMoments`).
"""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, malformed, mismatch
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.lab_plates import (
    LabPlates,
    PlateMoments,
    contradicting_moments,
    plate_left_out,
    to_ground,
    to_ground_plates,
)
from kinertia.io.text.number_table import read_lines, uneven, without_prefixes, wrong_cells
from kinertia.io.text.sto import header_entry
from kinertia.io.text.trc import METRES_PER_UNIT, seen_positions, unknown_unit
from kinertia.trial.data import FloatArray, Markers, Recording

_HEADER_LINES = 5
_HALF_A_SAMPLE = 0.5
_FASTEST_HZ = 1e6
_NEWTON_METRES = {"N.m": 1.0, "Nm": 1.0, "N.mm": 1e-3, "Nmm": 1e-3, "mm.N": 1e-3, "m.N": 1.0}
_MUCH_BETTER = 0.2
"""Forces are in other axes than they seem to be if there they miss the centre of pressure by so much less."""


@dataclass(frozen=True, eq=False)
class _Section:
    """A section of the file: rate, owner, name and unit of each column, rows (NaN where empty), their first line."""

    rate_hz: float
    owners: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: FloatArray
    first_line: int

    def columns(self, owner: str, names: Sequence[str]) -> list[int]:
        """Return the indices of these columns of an owner."""
        return [k for name in names for k in range(len(self.names)) if (self.owners[k], self.names[k]) == (owner, name)]


def read_vicon_csv(path: str | Path) -> Recording:
    """Read markers, and force plates where there are any, from an ASCII export of Nexus, turned to ground axes.

    Raises:
        FileError: the file is missing, broken, or has no trajectories.
    """
    path = Path(path)
    sections = dict(_sections(path))
    if "Trajectories" not in sections:
        found = f"no section Trajectories (sections: {', '.join(sections)})"
        raise FileError.found(path, "F164", found=Quantity(found))
    markers, findings = _markers(path, sections["Trajectories"])
    plates, time, plate_findings = _plates(path, sections.get("Devices"), markers.rate_hz)
    rotation, up, axis_findings = to_ground(path, "+Z", "Vicon's usual setting", markers.positions, plates)
    ground, load_findings = to_ground_plates(path, plates, rotation, time)
    return Recording(
        path.stem,
        markers.rotated(rotation),
        ground,
        findings=(*findings, *plate_findings, *axis_findings, *load_findings),
        length_unit="mm",
        vertical=up,
    )


def _sections(path: Path) -> Iterator[tuple[str, _Section]]:
    lines = read_lines(path)
    delimiter = max(",;\t", key=lambda mark: sum(line.count(mark) for line in lines[:10]))
    cells = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    begins = [
        k for k in range(len(cells) - _HEADER_LINES)
        if cells[k] and cells[k][0] and not any(cells[k][1:]) and _header_at(cells, k)
    ]  # fmt: skip
    if not begins:
        raise mismatch(path, "an ASCII export of Vicon Nexus", "no section of one", "Trajectories and Devices")
    for begin in begins:
        names = cells[begin + 3]
        rows, width = [], len(names)
        for number, row in enumerate(cells[begin + _HEADER_LINES :], start=begin + _HEADER_LINES + 1):
            if not any(row):
                break
            rows.append(_numbers(path, number, row, width))
        owners = _carried(cells[begin + 2], width)
        units = (cells[begin + 4] + [""] * width)[:width]
        table = np.array(rows).reshape(len(rows), width)
        rate_hz = _rate(path, begin + 2, cells[begin + 1][0])
        yield cells[begin][0], _Section(rate_hz, owners, tuple(names), tuple(units), table, begin + _HEADER_LINES + 1)


def _rate(path: Path, line: int, cell: str) -> float:
    try:
        rate_hz = float(cell)
    except ValueError:
        rate_hz = 0.0
    if not 0.0 < rate_hz < _FASTEST_HZ:
        raise header_entry(path, line, "the rate of the section", f"'{cell}'", "frames per second")
    return rate_hz


def _header_at(cells: Sequence[Sequence[str]], k: int) -> bool:
    rate, names = cells[k + 1], cells[k + 3]
    return bool(rate) and re.fullmatch(r"[\d.]+", rate[0]) is not None and [n.lower() for n in names[:2]] == [
        "frame", "sub frame"
    ]  # fmt: skip


def _carried(cells: Sequence[str], width: int) -> tuple[str, ...]:
    """Repeat each name over its columns, since it is written above the first one only."""
    result, current = [], ""
    for cell in (list(cells) + [""] * width)[:width]:
        current = cell or current
        result.append(current)
    return tuple(result)


def _numbers(path: Path, line: int, row: Sequence[str], width: int) -> list[float]:
    if len(row) > width and any(row[width:]):
        raise wrong_cells(path, line, len(row), width)
    values = []
    for column, cell in enumerate((list(row) + [""] * width)[:width], start=1):
        try:
            values.append(float(cell) if cell else np.nan)
        except ValueError:
            known = {"cell": Quantity(cell), "column": Quantity(column, "1")}
            raise malformed(path, line, f"'{cell}' in column {column}", "a number", **known) from None
    if np.isinf(values).any():
        column = int(np.argmax(np.isinf(values))) + 1
        known = {"cell": Quantity(row[column - 1]), "column": Quantity(column, "1")}
        raise malformed(path, line, f"an infinite value in column {column}", "a finite number", **known)
    return values


def _markers(path: Path, section: _Section) -> tuple[Markers, list[Finding]]:
    """Read markers in the laboratory's axes, m, with findings; columns not in a unit of length are not markers."""
    owners = [owner for owner in dict.fromkeys(section.owners) if len(section.columns(owner, "XYZ")) == 3]
    places = {owner: section.columns(owner, "XYZ") for owner in owners}
    places = {o: at for o, at in places.items() if section.units[at[0]] in METRES_PER_UNIT}
    labels, prefix_findings = without_prefixes(path, list(places))
    kept = {label: at for label, at in zip(labels, places.values(), strict=True) if label and not label.startswith("*")}
    if not kept or not len(section.rows):
        raise FileError.found(path, "F164", found=Quantity("no labelled ones in its section Trajectories"))
    unit = METRES_PER_UNIT[section.units[next(iter(kept.values()))[0]]]
    values = section.rows[:, [column for at in kept.values() for column in at]]
    lines = list(range(section.first_line, section.first_line + len(values)))
    positions, findings = seen_positions(path, values, tuple(kept), lines)
    frames = section.rows[:, 0]
    odd = np.flatnonzero(np.diff(frames) != 1)
    if odd.size:
        before, after = (frames[odd[0] : odd[0] + 2] - 1.0) / section.rate_hz
        raise uneven(path, lines[odd[0] + 1], before, after, 1.0 / section.rate_hz)
    return Markers((frames - 1.0) / section.rate_hz, tuple(kept), unit * positions), [*prefix_findings, *findings]


def _plates(
    path: Path, section: _Section | None, camera_hz: float
) -> tuple[LabPlates | None, FloatArray, list[Finding]]:
    """Read plates in the laboratory's axes, the times of their samples, and findings."""
    if section is None:
        return None, np.zeros(0), []
    time = (section.rows[:, 0] - 1.0) / camera_hz + section.rows[:, 1] / section.rate_hz
    _expect_every_sample(path, section, time)
    names, forces, moments = [], [], []
    findings: list[Finding] = []
    for owner in dict.fromkeys(section.owners):
        name, dash, what = owner.rpartition(" - ")
        if not dash or what != "Force":
            continue
        at = [section.columns(f"{name} - {kind}", columns) for kind, columns in _GROUPS]
        if any(len(columns) != 3 for columns in at):
            findings.append(plate_left_out(path, name, "it lacks columns; expected three of Force, Moment and CoP"))
            continue
        force, moment, point = (section.rows[:, columns] for columns in at)
        units = [section.units[columns[0]] for columns in at[1:]]
        if units[0] not in _NEWTON_METRES or units[1] not in METRES_PER_UNIT:
            known = f"'{units[0]}' and '{units[1]}'"
            raise unknown_unit(path, f"moments and CoP of {name}", known, "N.mm or N.m, and mm")
        moment, point = _NEWTON_METRES[units[0]] * moment, METRES_PER_UNIT[units[1]] * point
        force, moments_found, rotated = _in_lab_axes(force, moment, point)
        if rotated:
            findings.append(finding("F154", Where(path.name, plate=name)))
        if not moments_found.agree and np.isfinite(moments_found.mismatch):
            findings.append(contradicting_moments(path, name, moments_found.mismatch))
        names.append(name)
        forces.append(force)
        moments.append(moments_found.about_origin)
    if not names:
        return None, time, findings
    return LabPlates(tuple(names), np.stack(forces, axis=1), np.stack(moments, axis=1), None), time, findings


def _expect_every_sample(path: Path, section: _Section, time: FloatArray) -> None:
    """Raise FileError unless frames and sub-frames count up at the section's rate."""
    steps = section.rate_hz * np.diff(time, prepend=time[:1] - 1.0 / section.rate_hz)
    odd = np.flatnonzero(~(np.abs(steps - 1.0) < _HALF_A_SAMPLE))
    if odd.size:
        row = int(odd[0])
        before = time[row - 1] if row else time[0] - steps[0] / section.rate_hz
        raise uneven(path, section.first_line + row, before, time[row], 1.0 / section.rate_hz)


_GROUPS = (("Force", ("Fx", "Fy", "Fz")), ("Moment", ("Mx", "My", "Mz")), ("CoP", ("Cx", "Cy", "Cz")))
_TURNS = [
    np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, flip, flip])
    for (c, s), flip in product(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)), (1.0, -1.0))
]
"""A plate's axes in the laboratory's: turned by quarters, z up or down; the first is none."""


def _in_lab_axes(force: FloatArray, moment: FloatArray, point: FloatArray) -> tuple[FloatArray, PlateMoments, bool]:
    """Return force and moments in the axes of the centre of pressure, and whether they were rotated to them."""
    tried = [PlateMoments.of(force @ turn.T, moment @ turn.T, point) for turn in _TURNS]
    best = int(np.argmin([candidate.mismatch for candidate in tried]))
    if not np.isfinite(tried[best].mismatch):
        return force, tried[0], False
    if tried[best].mismatch > _MUCH_BETTER * tried[0].mismatch:
        best = 0
    return force @ _TURNS[best].T, tried[best], best != 0
