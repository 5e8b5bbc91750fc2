"""Tables that people write in a spreadsheet: CSV with a heading, as every country's programs save it.

Cells are separated by commas, semicolons or tabs. Where commas do not separate cells they may be decimal marks; where
they do, one with one or two digits behind it in a quoted cell is one, too ("1,234" might be a thousand).
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from kinertia.errors import FileError
from kinertia.io.number_table import expect_file

_SEPARATORS = ",;\t"
_BEGINNING_BYTES = 2000
_QUOTED_DECIMAL = re.compile(r"[-+]?\d+,\d{1,2}")


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        path, line: where it stands, the line one-based.
        cells: text by column (in lower case), without blanks around it.
        decimal_commas: commas may stand in numbers.
    """

    path: Path
    line: int
    cells: Mapping[str, str]
    decimal_commas: bool = False

    def number(self, column: str) -> float:
        """The number in a column.

        Raises:
            FileError: it is none, or not finite; with the line.

        Examples:
            >>> Row(Path("norms.csv"), 2, {"mean": "5,1"}, decimal_commas=True).number("mean")
            5.1
        """
        cell = self.cells[column]
        decimal_comma = self.decimal_commas or _QUOTED_DECIMAL.fullmatch(cell)
        try:
            value = float(cell.replace(",", ".") if decimal_comma else cell)
        except ValueError:
            raise FileError(self.path, f"{column} is '{cell}'; expected a number", self.line) from None
        if not math.isfinite(value):
            raise FileError(
                self.path, f"{column} is '{cell}'; expected a finite number; leave out rows without a value", self.line
            )
        return value


def has_columns(path: Path, columns: Sequence[str]) -> bool:
    """Whether a file is a table with these columns, by its name and its beginning; raises nothing for another one."""
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open("rb") as file:
        beginning = file.read(_BEGINNING_BYTES).decode("utf-8-sig", errors="replace")
    lines = beginning.lstrip().splitlines()
    return bool(lines) and set(columns) <= set(_opened(lines).heading)


class _Opened(NamedTuple):
    """What is below the heading, row by row; what separates cells; the columns, in lower case."""

    table: Any
    separator: str
    heading: list[str]


def _opened(lines: Sequence[str]) -> _Opened:
    separator = max(_SEPARATORS, key=lines[0].count)
    table = csv.reader(lines, delimiter=separator)
    return _Opened(table, separator, [cell.strip().lower() for cell in next(table)])


def read_csv(path: Path, columns: Sequence[str], expected: str) -> Iterator[Row]:
    """The rows of a table, blank ones left out; columns in any order, others are kept, missing cells at the end empty.

    Args:
        path: the file, UTF-8.
        columns: those that it must have.
        expected: what the table is, for messages.

    Raises:
        FileError: no such file, not text, columns or rows missing, or a row with too many cells; with the line.
    """
    expect_file(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FileError(path, "not UTF-8 text; save it as CSV UTF-8 (Excel: 'CSV UTF-8')") from None
    first = next((number for number, line in enumerate(lines) if line.strip()), None)
    if first is None:
        raise FileError(path, f"the file is empty; expected {expected}")
    table, separator, heading = _opened(lines[first:])
    if lacking := [name for name in columns if name not in heading]:
        found = ", ".join(heading)
        raise FileError(path, f"lacks the column {', '.join(lacking)}; found {found}; expected {expected}", first + 1)
    if several := [name for name in columns if heading.count(name) > 1]:
        raise FileError(path, f"has several columns {', '.join(several)}; leave one of them", first + 1)
    empty = True
    for cells in table:
        line = first + table.line_num
        if not any(cell.strip() for cell in cells):
            continue
        if any(cells[len(heading) :]):
            hint = "; a number has a decimal point where commas separate cells" if separator == "," else ""
            raise FileError(path, f"{len(cells)} cells in a row; expected {len(heading)} as in the heading{hint}", line)
        empty = False
        by_column = dict(zip_longest(heading, (cell.strip() for cell in cells[: len(heading)]), fillvalue=""))
        yield Row(path, line, by_column, decimal_commas=separator != ",")
    if empty:
        raise FileError(path, f"a heading and no rows; expected {expected}", first + 1)
