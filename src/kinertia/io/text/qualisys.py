"""Reads TSV files of Qualisys Track Manager: markers, and the force plates beside them.

QTM writes a trial's markers to `walk.tsv` and each plate to a file of its own, `walk_f_1.tsv`, `walk_f_2.tsv`
(`walk_f.tsv` where there is one). Both begin with lines of a name and a value. Forces are in the laboratory's axes or
in the plate's own, as stated in DESCRIPTION in the header, whose corners give the plate's position. Lengths are mm,
moments N m.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, mismatch
from kinertia.findings.finding import Finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.lab_plates import (
    LabPlates,
    PlateMoments,
    contradicting_moments,
    plate_left_out,
    to_ground,
    to_ground_plates,
)
from kinertia.io.text.number_table import most_seen, read_lines, read_rows
from kinertia.io.text.sto import header_entry, other_count
from kinertia.io.text.trc import seen_positions
from kinertia.trial.data import FloatArray, Markers, Recording

_MM = 1e-3
_CORNERS = ("POSX_POSY", "NEGX_POSY", "NEGX_NEGY", "POSX_NEGY")
_FASTEST_HZ = 1e6
_PLATE = re.compile(r"_f(_\d+)?$", re.IGNORECASE)
_COLUMNS = [f"{what}_{axis}" for what in ("Force", "Moment", "COP") for axis in "XYZ"]


def read_qualisys(path: str | Path, forces: Sequence[Path] | None = None) -> Recording:
    """Read markers and force plates of a trial from QTM's TSV files, turned to ground axes.

    Args:
        path: the file with the markers.
        forces: the files of its plates; those beside it by QTM's names if None.

    Raises:
        FileError: a file is missing, broken, or not written by QTM.
    """
    path = Path(path)
    beside = plates_beside(path) if forces is None else list(forces)
    markers, findings = _markers(path)
    single_plates = [_plate(file) for file in beside]
    plates, time = None, np.zeros(0)
    if single_plates:
        _expect_alike(beside, single_plates)
        time = markers.time[0] + np.arange(len(single_plates[0].force)) / single_plates[0].rate_hz
        plates = LabPlates(
            tuple(plate.name for plate in single_plates),
            np.stack([plate.force for plate in single_plates], axis=1),
            np.stack([plate.moment for plate in single_plates], axis=1),
            np.stack([plate.corners for plate in single_plates]),
        )
    rotation, up, axis_findings = to_ground(path, "+Z", "Qualisys' usual setting", markers.positions, plates)
    ground, load_findings = to_ground_plates(path, plates, rotation, time)
    more = [finding for plate in single_plates for finding in plate.findings]
    return Recording(
        path.stem,
        markers.rotated(rotation),
        ground,
        findings=(*findings, *_missing_plates(path, beside), *more, *axis_findings, *load_findings),
        length_unit="mm",
        vertical=up,
    )


def is_plate_file(path: Path) -> bool:
    """Return whether this is the name of a plate's file."""
    return path.suffix.lower() == ".tsv" and _PLATE.search(path.stem) is not None


def plates_beside(path: Path) -> list[Path]:
    """Return the plates' files of a trial, given its markers' file or one of them, in QTM's order."""
    stem = _PLATE.sub("", path.stem)
    files = [file for file in path.parent.iterdir() if is_plate_file(file) and _PLATE.sub("", file.stem) == stem]
    return sorted(files, key=lambda file: (len(file.stem), file.stem))


def _missing_plates(path: Path, files: Sequence[Path]) -> list[Finding]:
    """Return F151 for each number below the highest that no file of a plate has."""
    numbers = {int(match[1][1:]) for file in files if (match := _PLATE.search(file.stem)) and match[1]}
    return [
        plate_left_out(path, f"plate {k}", f"the file {path.stem}_f_{k}.tsv is missing")
        for k in range(1, max(numbers, default=0))
        if k not in numbers
    ]


def _header(path: Path, lines: Sequence[str]) -> tuple[dict[str, list[str]], int]:
    """Return name -> values of the lines before the rows, and the one-based line at which the rows begin."""
    header: dict[str, list[str]] = {}
    for number, line in enumerate(lines, start=1):
        name, *values = line.rstrip().split("\t")
        if _is_number(name):
            return header, number
        header.setdefault(name.strip(), [value.strip() for value in values])
    raise mismatch(path, "a TSV file of Qualisys Track Manager", "no row of numbers", "a header and rows of numbers")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(path: Path, header: dict[str, list[str]], name: str) -> float:
    value = (header.get(name) or [""])[0]
    if not _is_number(value):
        known = f"'{value}'" if name in header else "missing"
        raise header_entry(path, None, name, known, "a number, as Qualisys Track Manager writes it with a TSV header")
    if not np.isfinite(float(value)):
        raise header_entry(path, None, name, f"'{value}'", "a finite number")
    return float(value)


def _rate(path: Path, header: dict[str, list[str]]) -> float:
    rate_hz = _number(path, header, "FREQUENCY")
    if not 0.0 < rate_hz < _FASTEST_HZ:
        raise header_entry(path, None, "FREQUENCY", f"{rate_hz:g}", "frames or samples per second")
    return rate_hz


def _markers(path: Path) -> tuple[Markers, list[Finding]]:
    """Read markers in the laboratory's axes, m, with findings."""
    lines = read_lines(path)
    header, first = _header(path, lines)
    labels = tuple(label for label in header.get("MARKER_NAMES", ()) if label)
    if not labels:
        found = "no MARKER_NAMES in its header; export 3D data with the TSV header included"
        raise FileError.found(path, "F164", found=Quantity(found))
    rate = _rate(path, header)
    stated = int(_number(path, header, "NO_OF_FRAMES"))
    counted = {"Frame", "Time"} <= {name for cells in ([k, *v] for k, v in header.items()) for name in cells}
    wide = 3 * len(labels) + 2 * counted
    text = [line.replace("NULL", "") for line in lines]
    values, numbers = read_rows(path, text, first, wide, may_be_short=True)
    positions, findings = seen_positions(path, values[:, 2 * counted :], labels, numbers)
    if stated != len(values):
        findings.append(other_count(path, None, stated, len(values), "frames"))
    start = values[0, 1] if counted else 0.0
    chosen, repeated = most_seen(path, labels, np.asarray(np.isfinite(positions).all(axis=2)))
    time = start + np.arange(len(values)) / rate
    return Markers(time, tuple(chosen), _MM * positions[:, list(chosen.values())]), [*findings, *repeated]


@dataclass(frozen=True, eq=False)
class _Plate:
    """One plate in the laboratory's axes: force N, moment about the origin N m (k, 3), corners (4, 3) m."""

    name: str
    rate_hz: float
    force: FloatArray
    moment: FloatArray
    corners: FloatArray
    findings: list[Finding]


def _plate(path: Path) -> _Plate:
    lines = read_lines(path)
    header, first = _header(path, lines)
    names = next(([key, *values] for key, values in header.items() if "Force_X" in (key, *values)), None)
    if names is None or any(column not in names for column in _COLUMNS):
        lacking = ", ".join(column for column in _COLUMNS if column not in (names or ()))
        raise FileError.found(path, "F156", None, Where(plate=path.stem), columns=Quantity(f"the columns {lacking}"))
    values, _ = read_rows(path, [line.replace("NULL", "") for line in lines], first, len(names), may_be_short=True)
    force, moment, point = (
        values[:, [names.index(f"{what}_{axis}") for axis in "XYZ"]] for what in ("Force", "Moment", "COP")
    )
    corners = _MM * np.array(
        [[_number(path, header, f"FORCE_PLATE_CORNER_{corner}_{axis}") for axis in "XYZ"] for corner in _CORNERS]
    )
    point = _MM * point
    if "local" in " ".join(header.get("DESCRIPTION", ())).lower():
        turned = _axes(corners)
        force, moment, point = force @ turned, moment @ turned, corners.mean(axis=0) + point @ turned
    moments = PlateMoments.of(force, moment, point)
    name = (header.get("FORCE_PLATE_NAME") or [path.stem])[0] or path.stem
    wrong = not moments.agree and np.isfinite(moments.mismatch)
    findings = [contradicting_moments(path, name, moments.mismatch)] if wrong else []
    return _Plate(name, _rate(path, header), force, moments.about_origin, corners, findings)


def _axes(corners: FloatArray) -> FloatArray:
    """Return the plate's axes in the laboratory's as rows (3, 3), from its corners in the order of _CORNERS."""
    x = corners[[0, 3]].mean(axis=0) - corners[[1, 2]].mean(axis=0)
    y = corners[[0, 1]].mean(axis=0) - corners[[2, 3]].mean(axis=0)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def _expect_alike(files: Sequence[Path], plates: Sequence[_Plate]) -> None:
    for file, plate in zip(files, plates, strict=True):
        if plate.rate_hz != plates[0].rate_hz or len(plate.force) != len(plates[0].force):
            counts = {"samples": Quantity(len(plate.force), "1"), "rate_hz": Quantity(plate.rate_hz, "Hz")}
            other = f"{files[0].name} has {len(plates[0].force)} at {plates[0].rate_hz:g} Hz"
            raise FileError.found(file, "F155", **counts, other=Quantity(other))
