"""Reads text files of numbers: the part that TRC and STO/MOT have in common."""

from __future__ import annotations

import codecs
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity
from kinertia.io.file_names import missing_file
from kinertia.trial.data import FloatArray


def read_lines(path: Path) -> list[str]:
    """Read the lines of a text file with any line ends.

    Raises:
        FileError: the file is missing, empty or not text.
    """
    expect_file(path)
    content = path.read_bytes()
    if not content.strip():
        raise FileError.found(path, "F104", found=Quantity("it is empty"))
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        content = content.decode("utf-16", errors="replace").encode()
    if b"\0" in content[:4096]:
        kind = f"the text of a {path.suffix} file"
        raise mismatch(path, kind, "bytes of a binary file", "text")
    text = content.decode("utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def expect_file(path: Path, expected: str = "a file") -> None:
    """Raise a FileError that states the folder and the nearest names in it, unless `path` is a file."""
    if os.path.isfile(path):
        return
    if os.path.isdir(path):
        raise wrong_kind(path, "A folder", "be read here", expected)
    raise FileError.found(path, "F101", **missing_file(path, str(path), expected))


def expect_path(path: Path) -> None:
    """Raise a FileError unless a file or folder has this path."""
    if not os.path.exists(path):
        raise FileError.found(path, "F101", **missing_file(path, str(path), "a recording, a subject file or a folder"))


def wrong_kind(path: Path, given: str, what: str, expected: str) -> FileError:
    """Return the error that `given` "cannot {what}; expected {expected}"."""
    return FileError.found(path, "F102", given=Quantity(given), what=Quantity(what), expected=Quantity(expected))


def mismatch(path: Path, kind: str, found: str, expected: str, line: int | None = None) -> FileError:
    """Return the error that the content "is not {kind}: found {found}, expected {expected}"."""
    return FileError.found(path, "F103", line, found=Quantity(found), kind=Quantity(kind), expected=Quantity(expected))


def malformed(path: Path, line: int | None, found: str, expected: str, **known: Quantity) -> FileError:
    """Return the error of a cell or row: "found {found}; expected {expected}"; `cell` and `column` for one cell."""
    return FileError.found(path, "F105", line, **known, found=Quantity(found), expected=Quantity(expected))


def read_rows(
    path: Path, lines: Sequence[str], first_line: int, columns: int, may_be_short: bool = False
) -> tuple[FloatArray, list[int]]:
    """Read the numbers in the lines from one-based `first_line` on, blank lines left out.

    Cells are separated by tabs if the line has any, else by blanks; an empty cell is NaN and trailing empty
    cells may be missing altogether.

    Args:
        path: the file, for messages.
        lines: all lines of the file.
        first_line: one-based number of the line where the rows begin.
        columns: number of cells that a row has.
        may_be_short: rows that end early are filled up with NaN, if tabs separate their cells.

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
        cell = {"cell": Quantity("inf"), "column": Quantity(int(column_index) + 1, "1")}
        found = f"an infinite value in column {column_index + 1}"
        raise malformed(path, numbers[row_index], found, "a finite number", **cell)
    return values, numbers


def _complete(lines: list[str], columns: int) -> FloatArray | None:
    """Parse rows that all have every cell and nothing else; None if a row does not."""
    if not lines:
        return None
    try:
        values = np.loadtxt(lines, comments=None, delimiter="\t" if "\t" in lines[0] else None, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == columns else None


def _row(path: Path, number: int, line: str, columns: int, may_be_short: bool) -> list[float]:
    cells = line.split("\t") if "\t" in line else line.split()
    if len(cells) < columns == len(line.split()):  # blanks beside tabs
        cells = line.split()
    if len(cells) > columns or (len(cells) < columns and not may_be_short):
        raise wrong_cells(path, number, len(cells), columns)
    if 1 < len(cells) < columns and "\t" not in line:
        raise wrong_cells(path, number, len(cells), columns, ", as blanks do not show which are missing")
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
        expected = "a number with a decimal point" if commas else "a number"
        known = {"cell": Quantity(cell.strip()), "column": Quantity(column, "1")}
        raise malformed(path, line, f"'{cell.strip()}' in column {column}", expected, **known) from None


def wrong_cells(path: Path, line: int, cells: int, columns: int, hint: str = "") -> FileError:
    """Return the error of a row with too many or too few cells."""
    counts = {"cells": Quantity(cells, "1"), "columns": Quantity(columns, "1")}
    return malformed(path, line, f"{cells} values in the row", f"{columns} by the header{hint}", **counts)
