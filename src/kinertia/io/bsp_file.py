"""Body segment parameters of an earlier estimate: a CSV file in the form of `bsp.csv`."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.model.bsp import PARAMETERS, UNITS

_COLUMNS = ("segment", "parameter", "unit", "estimate", "sd")


@dataclass(frozen=True, eq=False)
class BspTable:
    """Estimates with their deviations.

    Attributes:
        name: of the file.
        segments: in the file's order.
        estimate, sd: (s, 10) in the order of `PARAMETERS`, SI.
    """

    name: str
    segments: tuple[str, ...]
    estimate: np.ndarray
    sd: np.ndarray


def read_bsp(path: Path) -> BspTable:
    """Read a file as `kinertia fit` writes it: one row per segment and parameter.

    Columns segment, parameter, unit, estimate and sd are needed, others are not looked at. Separated by commas, or as
    Excel saves it where the decimal mark is a comma, by semicolons.

    Raises:
        FileError: no such file, a column or a parameter is missing, or a value is none; with the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(path, "not UTF-8 text; save the file in the UTF-8 encoding") from None
    except OSError as error:
        raise FileError(path, error.strerror or "cannot be read") from None
    semicolons = ";" in text.partition("\n")[0]
    rows = csv.DictReader(io.StringIO(text), delimiter=";" if semicolons else ",")
    if missing := [name for name in _COLUMNS if name not in (rows.fieldnames or ())]:
        raise FileError(
            path,
            f"has no column {', '.join(missing)}; expected the bsp.csv of a simultaneous fit (two-level has no sd)",
            1,
        )
    values: dict[str, dict[str, tuple[float, float]]] = {}
    for row in rows:
        line, segment, parameter = rows.line_num, row["segment"], row["parameter"]
        if parameter not in PARAMETERS:
            raise FileError(path, f"unknown parameter '{parameter}'; expected one of {', '.join(PARAMETERS)}", line)
        unit = UNITS[PARAMETERS.index(parameter)]
        if row["unit"] != unit:
            raise FileError(path, f"{segment} {parameter} is in '{row['unit']}'; expected {unit}", line)
        if parameter in values.setdefault(segment, {}):
            raise FileError(path, f"{segment} {parameter} stands there twice", line)
        values[segment][parameter] = _value(path, row, "estimate", line), _value(path, row, "sd", line)
        if not values[segment][parameter][1] > 0.0:
            raise FileError(path, f"the sd of {segment} {parameter} must be positive", line)
    for segment, known in values.items():
        if lacking := [name for name in PARAMETERS if name not in known]:
            raise FileError(path, f"{segment} lacks {', '.join(lacking)}")
    if not values:
        raise FileError(path, "holds no rows")
    table = np.array([[known[name] for name in PARAMETERS] for known in values.values()])
    return BspTable(path.name, tuple(values), table[..., 0], table[..., 1])


def _value(path: Path, row: dict[str, str], column: str, line: int) -> float:
    try:
        value = float((row[column] or "").replace(",", "."))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileError(path, f"{column} = '{row[column]}' is no number", line)
    return value
