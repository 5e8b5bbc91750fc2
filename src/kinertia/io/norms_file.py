"""Reads a laboratory's norms: mean and standard deviation of curves over the gait cycle, from CSV.

    quantity,percent,mean,sd
    knee_angle_angle,0,5.1,3.9
    knee_angle_angle,1,6.0,4.1

Names and units of the quantities are those of `cycles.csv`. Percents may be coarser; measures of strides, such as
speed_m_s, have a row at 0 %. `kinertia norms` adds the number
of people (n), spans of age and speed, and the convention of each quantity.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.text.csv_file import Row, read_csv

COLUMNS = ("quantity", "percent", "mean", "sd")
Span = tuple[float, float]
"""Least and largest."""
_SPANS = ("age_years", "speed_m_s")
_LARGEST_SHARE = 1.0
"""A file whose percents all stay below is one of shares."""


@dataclass(frozen=True, eq=False)
class Norm:
    """Normative curve of one quantity.

    Attributes:
        percent: (n,) percent of the gait cycle, ascending.
        mean, sd: (n,) mean and SD in the quantity's unit.
        people: number of people, where the file states it; the fewest at any percent.
        convention: definition of the quantity, where the file states it.
        age_years, speed_m_s: ranges of these people, where the file states them.
    """

    percent: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    people: int | None = None
    convention: str = ""
    age_years: Span | None = None
    speed_m_s: Span | None = None


def read_norms(path: str | Path) -> dict[str, Norm]:
    """Read norms by quantity ("knee_angle_moment").

    Raises:
        FileError: the file is missing or not text, lacks a column, or has an impossible row; with the line.
    """
    curves: dict[str, dict[float, tuple[float, float]]] = {}
    stated: dict[str, list[Row]] = {}
    for row in read_csv(Path(path), COLUMNS, "a row per quantity and percent: " + ",".join(COLUMNS)):
        quantity = row.cells["quantity"]
        percent, mean, sd = (row.number(name) for name in COLUMNS[1:])
        _expect_sound(row, percent, sd)
        curve = curves.setdefault(quantity, {})
        if percent in curve:
            raise _wrong(row.path, row.line, f"{quantity} at {percent:g} % is there twice")
        curve[percent] = (mean, sd)
        stated.setdefault(quantity, []).append(row)
    if curves and 0.0 < max(map(max, curves.values())) <= _LARGEST_SHARE:
        largest = Quantity(max(map(max, curves.values())), "1")
        raise _wrong(Path(path), None, "percent is at most 1; multiply the column by 100", percent=largest)
    return {name: _norm(curve, stated[name]) for name, curve in curves.items()}


def _expect_sound(row: Row, percent: float, sd: float) -> None:
    if not 0 <= percent <= 100:
        raise _wrong(row.path, row.line, f"percent is {percent:g}", percent=Quantity(percent, "1", limit=100.0))
    if sd < 0:
        raise _wrong(row.path, row.line, f"sd is {sd:g}; it must not be negative", sd=Quantity(sd, "1", limit=0.0))


def _wrong(path: Path, line: int | None, problem: str, **evidence: Quantity) -> FileError:
    return FileError.found(path, "F187", line, **evidence, problem=Quantity(problem))


def _norm(curve: Mapping[float, Sequence[float]], rows: Sequence[Row]) -> Norm:
    percent, last = sorted(curve), rows[-1]
    mean, sd = np.array([curve[key] for key in percent]).T
    convention = last.cells.get("convention", "")
    counts = [int(row.number("n")) for row in rows if convention and row.cells.get("n")]
    spans = (_span(last, name) if convention else None for name in _SPANS)
    return Norm(np.array(percent), mean, sd, min(counts, default=None), convention, *spans)


def _span(row: Row, name: str) -> Span | None:
    ends = (f"{name}_min", f"{name}_max")
    return (row.number(ends[0]), row.number(ends[1])) if all(row.cells.get(end) for end in ends) else None
