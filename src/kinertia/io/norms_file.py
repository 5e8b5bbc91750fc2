"""Norms of a laboratory: mean and standard deviation of curves over the gait cycle, from a CSV file.

    quantity,percent,mean,sd
    knee_angle_angle,0,5.1,3.9
    knee_angle_angle,1,6.0,4.1

Names and units of the quantities are those of `cycles.csv`. Percents may be coarser than there. Spreadsheet programs of
many countries write semicolons between cells and commas in numbers; such a file is read as well.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.io.number_table import read_lines

COLUMNS = ("quantity", "percent", "mean", "sd")
_NUMBERS = COLUMNS[1:]


@dataclass(frozen=True, eq=False)
class Norm:
    """One quantity of people who are taken as normal.

    Attributes:
        percent: (n,) of the gait cycle, ascending.
        mean, sd: (n,) in the quantity's unit.
    """

    percent: np.ndarray
    mean: np.ndarray
    sd: np.ndarray


def read_norms(path: str | Path) -> dict[str, Norm]:
    """Norms by quantity ("knee_angle_moment").

    Raises:
        FileError: the file is missing or not text, lacks a column, or has a row that cannot be; with the line.
    """
    path = Path(path)
    lines = read_lines(path)
    first = next(number for number, line in enumerate(lines) if line.strip())
    delimiter = ";" if ";" in lines[first] else "," if "," in lines[first] else "\t"
    header = [cell.strip().lower() for cell in next(csv.reader([lines[first]], delimiter=delimiter))]
    if lacking := [name for name in COLUMNS if name not in header]:
        columns = ", ".join(header)
        raise FileError(
            path, f"lacks the columns {', '.join(lacking)}; found {columns}; expected {','.join(COLUMNS)}", 1
        )
    rows: dict[str, dict[float, tuple[float, float]]] = {}
    for number, cells in enumerate(csv.reader(lines[first + 1 :], delimiter=delimiter), start=first + 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) < len(header):
            raise FileError(path, f"{len(cells)} cells in a row; expected {len(header)} as in the header", number)
        row = dict(zip(header, (cell.strip() for cell in cells), strict=False))
        percent, mean, sd = (_number(path, number, name, row[name], delimiter) for name in _NUMBERS)
        _expect_sound(path, number, percent, sd)
        curve = rows.setdefault(row["quantity"], {})
        if percent in curve:
            raise FileError(
                path, f"{row['quantity']} at {percent:g} % is there already; give each percent once", number
            )
        curve[percent] = (mean, sd)
    if not rows:
        raise FileError(path, "a header and no rows; expected a row per quantity and percent")
    return {name: _norm(curve) for name, curve in rows.items()}


def _number(path: Path, line: int, name: str, cell: str, delimiter: str) -> float:
    try:
        value = float(cell if delimiter == "," else cell.replace(",", "."))
    except ValueError:
        raise FileError(path, f"{name} is '{cell}'; expected a number", line) from None
    if not math.isfinite(value):
        raise FileError(path, f"{name} is '{cell}'; expected a finite number; leave out rows without a value", line)
    return value


def _expect_sound(path: Path, line: int, percent: float, sd: float) -> None:
    if not 0 <= percent <= 100:
        raise FileError(path, f"percent is {percent:g}; expected 0 to 100 % of the gait cycle", line)
    if sd < 0:
        raise FileError(path, f"sd is {sd:g}; expected a standard deviation, which is not negative", line)


def _norm(curve: Mapping[float, Sequence[float]]) -> Norm:
    percent = sorted(curve)
    mean, sd = np.array([curve[one] for one in percent]).T
    return Norm(np.array(percent), mean, sd)
