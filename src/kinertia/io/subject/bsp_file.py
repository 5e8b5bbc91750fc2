"""Reads body segment parameters of an earlier estimate: a CSV file in the form of `bsp.csv`."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.text.csv_file import read_csv
from kinertia.model.bsp import PARAMETERS, UNITS

_COLUMNS = ("segment", "parameter", "unit", "estimate", "sd")


@dataclass(frozen=True, eq=False)
class BspTable:
    """Estimates of body segment parameters with their SDs.

    Attributes:
        name: name of the file.
        segments: segments in the file's order.
        estimate, sd: (s, 10) in the order of `PARAMETERS`, SI; SDs of a fixed segment are all zero.
    """

    name: str
    segments: tuple[str, ...]
    estimate: np.ndarray
    sd: np.ndarray


def read_bsp(path: Path) -> BspTable:
    """Read a file as `kinertia fit` writes it: one row per segment and parameter.

    Columns segment, parameter, unit, estimate and sd are needed, others are ignored.

    Raises:
        FileError: no such file, a column or a parameter is missing, or a value is not a number; with the line.
    """
    values: dict[str, dict[str, tuple[float, float]]] = {}
    without_sd: dict[str, dict[str, int]] = {}
    for row in read_csv(path, _COLUMNS, "the bsp.csv of a simultaneous fit"):
        line, segment, parameter, written_unit = row.line, *(row.cells[name] for name in _COLUMNS[:3])
        if parameter not in PARAMETERS:
            raise _wrong(path, line, segment, parameter, f"no such parameter; expected one of {', '.join(PARAMETERS)}")
        unit = UNITS[PARAMETERS.index(parameter)]
        if written_unit != unit:
            raise _wrong(path, line, segment, parameter, f"its unit is '{written_unit}'; expected {unit}")
        if parameter in values.setdefault(segment, {}):
            raise _wrong(path, line, segment, parameter, "it is there twice")
        values[segment][parameter] = row.number("estimate"), row.number("sd")
        if not values[segment][parameter][1] > 0.0:
            without_sd.setdefault(segment, {})[parameter] = line
    for segment, known in values.items():
        if lacking := [name for name in PARAMETERS if name not in known]:
            raise _wrong(path, None, segment, ", ".join(lacking), "missing")
    for segment, lines in without_sd.items():
        parameter, line = next(iter(lines.items()))
        if any(sd != 0.0 for _, sd in values[segment].values()):
            raise _wrong(path, line, segment, parameter, "its sd must be positive")
    table = np.array([[known[name] for name in PARAMETERS] for known in values.values()])
    return BspTable(path.name, tuple(values), table[..., 0], table[..., 1])


def _wrong(path: Path, line: int | None, segment: str, parameter: str, problem: str) -> FileError:
    words = {"parameter": Quantity(parameter), "problem": Quantity(problem)}
    return FileError.found(path, "F183", line, Where(part=segment), **words)
