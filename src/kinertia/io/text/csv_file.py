"""Reads tables written in a spreadsheet: CSV with a heading, in any country's format.

Cells are separated by commas, semicolons or tabs. Where commas do not separate cells they may be decimal marks; where
they do, a comma in a quoted cell is a decimal mark if one or two digits follow ("1,234" might be a thousand).
"""

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from kinertia.errors import FileError, expect_file, malformed, mismatch
from kinertia.findings.quantity import Quantity
from kinertia.io.text.number_table import wrong_cells
from kinertia.io.text.sto import expect_once

_SEPARATORS = ",;\t"
_BEGINNING_BYTES = 2000
_QUOTED_DECIMAL = re.compile(r"[-+]?\d+,\d{1,2}")


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        path, line: its file and its one-based line.
        cells: text by column (in lower case), without blanks around it.
        decimal_commas: whether numbers may have decimal commas.
    """

    path: Path
    line: int
    cells: Mapping[str, str]
    decimal_commas: bool = False

    def number(self, column: str) -> float:
        """Return the number in a column.

        Raises:
            FileError: it is not a number, or not finite; with the line.

        Examples:
            >>> Row(Path("norms.csv"), 2, {"mean": "5,1"}, decimal_commas=True).number("mean")
            5.1
        """
        cell = self.cells[column]
        decimal_comma = self.decimal_commas or _QUOTED_DECIMAL.fullmatch(cell)
        try:
            value = float(cell.replace(",", ".") if decimal_comma else cell)
        except ValueError:
            raise self._malformed(column, "a number") from None
        if not math.isfinite(value):
            raise self._malformed(column, "a finite number (leave out rows without a value)")
        return value

    def _malformed(self, column: str, expected: str) -> FileError:
        cell = self.cells[column]
        known = {"cell": Quantity(cell), "column": Quantity(column)}
        return malformed(self.path, self.line, f"'{cell}' in column {column}", expected, **known)


def has_columns(path: Path, columns: Sequence[str]) -> bool:
    """Return whether a file is a table with these columns, by its name and beginning; other files raise no error."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open("rb") as file:
        beginning = file.read(_BEGINNING_BYTES).decode("utf-8-sig", errors="replace")
    lines = beginning.lstrip().splitlines()
    return bool(lines) and set(columns) <= set(_opened(lines).heading)


class _Opened(NamedTuple):
    """An opened table: its rows below the heading, the separator of cells, and the columns in lower case."""

    table: Any
    separator: str
    heading: list[str]


def _opened(lines: Sequence[str]) -> _Opened:
    separator = max(_SEPARATORS, key=lines[0].count)
    table = csv.reader(lines, delimiter=separator)
    return _Opened(table, separator, [cell.strip().lower() for cell in next(table)])


def read_csv(path: Path, columns: Sequence[str], expected: str) -> Iterator[Row]:
    """Yield the rows of a table without blank ones; columns in any order, others kept, missing cells at the end empty.

    Args:
        path: the file, UTF-8.
        columns: columns that it must have.
        expected: what the table is, for messages.

    Raises:
        FileError: no such file, not text, columns or rows missing, or a row with too many cells; with the line.
    """
    expect_file(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise mismatch(path, expected, "text not in UTF-8", "CSV in UTF-8 (Excel: 'CSV UTF-8')") from None
    first = next((number for number, line in enumerate(lines) if line.strip()), None)
    if first is None:
        raise FileError.found(path, "F104", found=Quantity(f"it is empty; expected {expected}"))
    table, separator, heading = _opened(lines[first:])
    if lacking := [name for name in columns if name not in heading]:
        raise mismatch(path, expected, f"the columns {', '.join(heading)}", f"also {', '.join(lacking)}", first + 1)
    expect_once(path, [name for name in heading if name in columns], first + 1)
    empty = True
    for cells in table:
        line = first + table.line_num
        if not any(cell.strip() for cell in cells):
            continue
        if any(cells[len(heading) :]):
            hint = ", with decimal points where commas separate cells" if separator == "," else ""
            raise wrong_cells(path, line, len(cells), len(heading), hint)
        empty = False
        by_column = dict(zip_longest(heading, (cell.strip() for cell in cells[: len(heading)]), fillvalue=""))
        yield Row(path, line, by_column, decimal_commas=separator != ",")
    if empty:
        rows = {"rows": Quantity(0, "1")}
        found = Quantity(f"it has a heading but no rows; expected {expected}")
        raise FileError.found(path, "F104", first + 1, **rows, found=found)


T = TypeVar("T")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def inert(cell: T) -> T | str:
    """Return a cell that no spreadsheet program interprets as a formula: such text gets a leading apostrophe.

    Names come from files that others made: Excel would run a body called `=cmd|' /C calc'!A0`.
    """
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell
