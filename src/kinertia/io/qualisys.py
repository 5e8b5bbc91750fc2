"""TSV files of Qualisys Track Manager: markers, and the force plates beside them.

QTM writes a trial's markers to `walk.tsv` and each plate to a file of its own, `walk_f_1.tsv`, `walk_f_2.tsv`
(`walk_f.tsv` where there is one). Both begin with lines of a name and a value. Forces are in the laboratory's axes or
in the plate's own, as the header's DESCRIPTION says; the corners in it tell where the plate is. Lengths are mm, moments
N m.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.io.c3d_plates import LabPlates, to_ground_plates
from kinertia.io.lab_axes import to_ground
from kinertia.io.number_table import read_lines, read_rows
from kinertia.io.plate_moments import PlateMoments
from kinertia.io.trc import seen_positions
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
        FileError: a file is missing, broken, or none that QTM writes.
    """
    path = Path(path)
    beside = plates_beside(path) if forces is None else list(forces)
    markers, notes = _markers(path)
    single_plates = [_plate(file) for file in beside]
    plates, time = None, np.zeros(0)
    if single_plates:
        _expect_alike(beside, single_plates)
        time = markers.time[0] + np.arange(len(single_plates[0].force)) / single_plates[0].rate_hz
        plates = LabPlates(
            tuple(one.name for one in single_plates),
            np.stack([one.force for one in single_plates], axis=1),
            np.stack([one.moment for one in single_plates], axis=1),
            np.stack([one.corners for one in single_plates]),
        )
    rotation, up, axis_notes = to_ground(path, "+Z", "Qualisys' usual setting", markers.positions, plates)
    ground, load_notes = to_ground_plates(path, plates, rotation, time) if plates is not None else (None, [])
    read = [f"{path.name}: plates from {', '.join(file.name for file in beside)}"] if beside else []
    more = [note for one in single_plates for note in one.notes]
    return Recording(
        path.stem,
        markers.rotated(rotation),
        ground,
        notes=(*notes, *read, *more, *axis_notes, *load_notes),
        length_unit="mm",
        vertical=up,
    )


def is_plate_file(path: Path) -> bool:
    """Whether its name is that of a plate's file."""
    return path.suffix.lower() == ".tsv" and _PLATE.search(path.stem) is not None


def plates_beside(path: Path) -> list[Path]:
    """The plates' files of a trial, by its markers' file or by one of them, in QTM's order."""
    stem = _PLATE.sub("", path.stem)
    files = [file for file in path.parent.iterdir() if is_plate_file(file) and _PLATE.sub("", file.stem) == stem]
    return sorted(files, key=lambda file: (len(file.stem), file.stem))


def _header(path: Path, lines: Sequence[str]) -> tuple[dict[str, list[str]], int]:
    """Name -> values of the lines before the rows, and the one-based line at which these begin."""
    header: dict[str, list[str]] = {}
    for number, line in enumerate(lines, start=1):
        name, *values = line.rstrip().split("\t")
        if _is_number(name):
            return header, number
        header.setdefault(name.strip(), [value.strip() for value in values])
    raise FileError(path, "no row of numbers in it; expected a TSV file of Qualisys Track Manager, export it again")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(path: Path, header: dict[str, list[str]], name: str) -> float:
    value = (header.get(name) or [""])[0]
    if not _is_number(value):
        problem = f"{name} is '{value}'" if name in header else f"its header has no {name}"
        raise FileError(path, f"{problem}; expected a number, as Qualisys Track Manager writes it with a TSV header")
    if not np.isfinite(float(value)):
        raise FileError(path, f"{name} is '{value}'; expected a finite number")
    return float(value)


def _rate(path: Path, header: dict[str, list[str]]) -> float:
    rate_hz = _number(path, header, "FREQUENCY")
    if not 0.0 < rate_hz < _FASTEST_HZ:
        raise FileError(path, f"FREQUENCY is {rate_hz:g}; expected frames or samples per second, export it again")
    return rate_hz


def _markers(path: Path) -> tuple[Markers, list[str]]:
    """Markers in the laboratory's axes, m, and notes."""
    lines = read_lines(path)
    header, first = _header(path, lines)
    labels = tuple(label for label in header.get("MARKER_NAMES", ()) if label)
    if not labels:
        raise FileError(path, "its header has no MARKER_NAMES; export 3D data with the TSV header included")
    if repeated := [label for label in dict.fromkeys(labels) if labels.count(label) > 1]:
        raise FileError(path, f"MARKER_NAMES has {', '.join(repeated)} more than once; give every marker its own label")
    rate = _rate(path, header)
    stated = int(_number(path, header, "NO_OF_FRAMES"))
    counted = {"Frame", "Time"} <= {name for cells in ([k, *v] for k, v in header.items()) for name in cells}
    wide = 3 * len(labels) + 2 * counted
    text = [line.replace("NULL", "") for line in lines]
    values, numbers = read_rows(path, text, first, wide, may_be_short=True)
    positions, zero_notes = seen_positions(path, values[:, 2 * counted :], labels, numbers)
    notes = [*zero_notes]
    if stated != len(values):
        notes.append(f"{path.name}: its header announces {stated} frames, the file has {len(values)}: all were read")
    start = values[0, 1] if counted else 0.0
    return Markers(start + np.arange(len(values)) / rate, labels, _MM * positions), notes


@dataclass(frozen=True, eq=False)
class _Plate:
    """One plate in the laboratory's axes: force N, moment about the origin N m (k, 3), corners (4, 3) m."""

    name: str
    rate_hz: float
    force: FloatArray
    moment: FloatArray
    corners: FloatArray
    notes: list[str]


def _plate(path: Path) -> _Plate:
    lines = read_lines(path)
    header, first = _header(path, lines)
    names = next(([key, *values] for key, values in header.items() if "Force_X" in (key, *values)), None)
    if names is None or any(column not in names for column in _COLUMNS):
        raise FileError(path, f"expected columns {', '.join(_COLUMNS)}, as Qualisys Track Manager exports forces")
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
    notes = []
    if not moments.agree and np.isfinite(moments.misses):
        notes.append(
            f"{path.name}: moments and centre of pressure contradict each other (by {100 * moments.misses:.0f} %); the "
            f"centre of pressure was taken, without a free moment"
        )
    return _Plate(name, _rate(path, header), force, moments.about_origin, corners, notes)


def _axes(corners: FloatArray) -> FloatArray:
    """(3, 3) rows: the plate's axes in the laboratory's, from its corners in the order of _CORNERS."""
    x = corners[[0, 3]].mean(axis=0) - corners[[1, 2]].mean(axis=0)
    y = corners[[0, 1]].mean(axis=0) - corners[[2, 3]].mean(axis=0)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def _expect_alike(files: Sequence[Path], plates: Sequence[_Plate]) -> None:
    for file, plate in zip(files, plates, strict=True):
        if plate.rate_hz != plates[0].rate_hz or len(plate.force) != len(plates[0].force):
            raise FileError(
                file,
                f"{len(plate.force)} samples at {plate.rate_hz:g} Hz, {files[0].name} has {len(plates[0].force)} at "
                f"{plates[0].rate_hz:g} Hz; export all plates of the trial together",
            )
