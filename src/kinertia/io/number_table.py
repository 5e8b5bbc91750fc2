"""Text files of numbers: the part that TRC and STO/MOT have in common."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.trial.data import FloatArray


def read_lines(path: Path) -> list[str]:
    """The lines of a text file, whatever its line ends.

    Raises:
        FileError: the file is missing, empty or not text.
    """
    expect_file(path)
    content = path.read_bytes()
    if not content.strip():
        raise FileError(path, "the file is empty; expected a header and rows of numbers, export it again")
    if b"\0" in content[:4096]:
        raise FileError(path, f"a binary file; expected the text of a {path.suffix} file, export it again")
    text = content.decode("utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def expect_file(path: Path) -> None:
    """Raise a FileError that names the folder and the nearest names in it, unless `path` is a file."""
    if path.is_file():
        return
    folder = path.parent.absolute()
    if not folder.is_dir():
        raise FileError(path, f"no such file: there is no folder {folder}; give the path of an existing file")
    names = [entry.name for entry in folder.iterdir() if entry.is_file()]
    nearest = get_close_matches(path.name, names, n=3, cutoff=0.4)
    hint = f"the nearest names there are {', '.join(nearest)}" if nearest else "nothing there has a name like it"
    raise FileError(path, f"no such file; looked in {folder}, {hint}")


def read_rows(
    path: Path, lines: Sequence[str], first_line: int, columns: int, may_be_short: bool = False
) -> tuple[FloatArray, list[int]]:
    """The numbers in the lines from one-based `first_line` on, blank lines left out.

    Cells are separated by tabs if the line has any, else by blanks; an empty cell is NaN and trailing empty
    cells may be missing altogether.

    Args:
        path: the file, for messages.
        lines: all lines of the file.
        first_line: one-based number of the line where the rows begin.
        columns: number of cells that a row has.
        may_be_short: rows that end early are filled up with NaN.

    Returns:
        (n, columns) the numbers, and the one-based line number of each row.

    Raises:
        FileError: a cell is not a number, or a row has too many or too few cells; with the line.
    """
    kept = [(number, line.rstrip()) for number, line in enumerate(lines[first_line - 1 :], start=first_line)]
    kept = [(number, line) for number, line in kept if line]
    numbers = [number for number, _ in kept]
    values = _complete([line for _, line in kept], columns)
    if values is None:
        rows = [_row(path, number, line, columns, may_be_short) for number, line in kept]
        values = np.array(rows, dtype=float).reshape(len(rows), columns)
    if np.isinf(values).any():
        row_index, column_index = np.argwhere(np.isinf(values))[0]
        raise FileError(path, f"infinite value in column {column_index + 1}; expected a number", numbers[row_index])
    return values, numbers


def _complete(lines: list[str], columns: int) -> FloatArray | None:
    """The numbers of rows that have all their cells and nothing else in them; None if there is a row that has not."""
    if not lines:
        return None
    try:
        values = np.loadtxt(lines, comments=None, delimiter="\t" if "\t" in lines[0] else None, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == columns else None


def _row(path: Path, number: int, line: str, columns: int, may_be_short: bool) -> list[float]:
    cells = line.split("\t") if "\t" in line else line.split()
    if len(cells) > columns or (len(cells) < columns and not may_be_short):
        raise FileError(
            path,
            f"the row has {len(cells)} values, expected {columns} as the header says; repair or export it again",
            number,
        )
    try:
        row = list(map(float, cells))
    except ValueError:
        row = [_cell(path, number, column, cell) for column, cell in enumerate(cells, start=1)]
    return row + [math.nan] * (columns - len(row))


def _cell(path: Path, line: int, column: int, cell: str) -> float:
    if not cell.strip():
        return math.nan
    try:
        return float(cell)
    except ValueError:
        commas = re.fullmatch(r"\s*[-+]?\d+,\d+(e[-+]?\d+)?\s*", cell, re.IGNORECASE)
        hint = "export it again with decimal points" if commas else "repair or export it again"
        raise FileError(path, f"'{cell.strip()}' in column {column} is not a number; {hint}", line) from None
