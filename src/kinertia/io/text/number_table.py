"""Reads text files of numbers: tables, uniform times, and marker labels, as all formats share them."""

from __future__ import annotations

import codecs
import contextlib
import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, expect_file, malformed, mismatch
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.trial.data import BoolArray, FloatArray
from kinertia.trial.sampled_data import step_evidence

_MOST_DECIMALS = 7
_COARSEST_S = 0.01
"""Times in coarser units hardly show where samples are missing."""
_OFF = 0.75
"""Largest distance of rounded times from even ones, in units: half a unit and the error of the straight line."""
_FEWEST_ODD, _ODD_SHARE = 5, 0.02
"""Rounding makes irregular steps all the time; a missing or repeated sample makes one."""
_FEWEST_BEFORE_LAST = 10
"""With fewer samples it is unknown which one is irregular."""
LARGEST_STEP_S = 0.1
"""Plates are sampled at 50 Hz and more, also once they were reduced to the rate of slow cameras."""
_NOTICED = 0.05
"""Share of a step; times with smaller deviations stay unchanged."""
_PERSON_SHARE = 0.5
"""Share of the largest person's labels; a prefix with fewer is no second person, but a wand, or a stray label."""


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


def rounding_s(time: FloatArray) -> float:
    """Return the unit of the last decimal of the times; 0 where there are too many decimals."""
    for decimals in range(_MOST_DECIMALS):
        if np.abs(time - time.round(decimals)).max() < 1e-9:
            return float(10.0**-decimals)
    return 0.0


def uniform_times(path: Path, time: FloatArray) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Return times (k,) s of forces unchanged, or on the even grid that they were rounded from, with findings.

    Only the times show the rate: the grid is the straight line through them (T102). At 2000 Hz and in whole
    milliseconds every other step is zero. If only the last time is irregular, its sample is left out (T105): then the
    times are k - 1.

    Raises:
        FileError: samples are missing or repeated, time goes back, or its unit is not the second.
    """
    try:
        return _even(path, time)
    except FileError:
        if len(time) < _FEWEST_BEFORE_LAST:
            raise
        with contextlib.suppress(FileError):
            kept, findings = _even(path, time[:-1])
            evidence = step_evidence(time[-2], time[-1], float(np.median(np.diff(time))))
            return kept, (with_evidence("T105", Where(path.name), evidence), *findings)
        raise


def _even(path: Path, time: FloatArray) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Return even times and findings, with the last time treated as all others."""
    steps = np.diff(time)
    if not steps.size:
        return time, ()
    usual = float(np.median(steps))
    if usual > LARGEST_STEP_S:
        raise FileError.found(path, "T106", step_s=Quantity(usual, "s", limit=LARGEST_STEP_S))
    odd = np.flatnonzero((steps <= 0) | (np.abs(steps - usual) > 0.5 * abs(usual)))
    unit = rounding_s(time)
    step, start = np.polyfit(np.arange(len(time)), time, 1)
    even = start + step * np.arange(len(time))
    error = float(np.abs(time - even).max())
    rounded = 0 < unit <= _COARSEST_S and step > 0 and error <= _OFF * unit
    often = odd.size >= _FEWEST_ODD and odd.size > _ODD_SHARE * steps.size
    if odd.size and not (rounded and often):
        raise uneven(path, None, time[odd[0]], time[odd[0] + 1], usual)
    if not rounded or error <= _NOTICED * step:
        return time, ()
    return even, (times_rounded(path, unit, 1 / step),)


def uneven(path: Path, line: int | None, before: float, after: float, usual: float) -> FileError:
    """Return the error for two times (s) whose step is irregular."""
    return FileError.found(path, "T101", line, **step_evidence(before, after, usual))


def times_rounded(path: Path, rounding: float, rate_hz: float) -> Finding:
    """Return T102: times were rounded by this many seconds and replaced by times at an even rate."""
    return finding(
        "T102", Where(path.name), rounding_s=Quantity(float(rounding), "s"), rate_hz=Quantity(float(rate_hz), "Hz")
    )


def people_among(labels: Sequence[str]) -> dict[str, int]:
    """Return prefixes with about as many labels as any other, with their number of labels; most first."""
    prefixes = Counter(label.split(":", 1)[0] for label in labels if ":" in label).most_common()
    return {name: count for name, count in prefixes if count > _PERSON_SHARE * prefixes[0][1]}


def without_prefixes(path: Path, labels: Sequence[str], subject: str = "") -> tuple[list[str], list[Finding]]:
    """Remove `subject:` from labels and report it (F163); only the person of the trial loses the prefix.

    Args:
        path: the file.
        labels: labels of all its markers.
        subject: name of the trial's person; if empty, the person with most labels.

    Raises:
        FileError: several people have about as many labels, and the trial's person is unknown.
    """
    people = people_among(labels)
    if not people:
        return list(labels), []
    if len(people) > 1 and not subject:
        counted = ", ".join(f"{name}: {count}" for name, count in people.items())
        raise FileError.found(path, "F161", people=Quantity(counted), count=Quantity(len(people), "1"))
    subject = subject or next(iter(people))
    others = {label.split(":", 1)[0] for label in labels if ":" in label} - {subject}
    names = [label.removeprefix(subject + ":") for label in labels]
    kept = f" (not those of {', '.join(sorted(others))})" if others else ""
    count = sum(label != name for label, name in zip(labels, names, strict=True))
    return names, [left_out(path, count, f"label prefixes '{subject}:'{kept}")]


def left_out(path: Path, count: int, what: str) -> Finding:
    """Return the finding that a number of points, or parts of labels, were left out."""
    return finding("F163", Where(path.name), count=Quantity(count, "1"), what=Quantity(what))


def most_seen(path: Path, labels: Sequence[str], seen: BoolArray) -> tuple[dict[str, int], list[Finding]]:
    """Choose one trajectory for each label, the one in most frames, of equals the first; F113 lists repeated labels.

    Args:
        path: the file, for findings.
        labels: labels of the m trajectories.
        seen: (n, m) whether a frame shows them.

    Returns:
        label -> column of its trajectory, in the order of the file, and what was found.
    """
    chosen: dict[str, int] = {}
    frames = seen.sum(axis=0)
    for column, label in enumerate(labels):
        if label not in chosen or frames[column] > frames[chosen[label]]:
            chosen[label] = column
    findings = []
    for label, times in Counter(labels).items():
        if times > 1:
            evidence = {"count": Quantity(times, "1"), "label": Quantity(label)}
            findings.append(with_evidence("F113", Where(path.name, markers=(label,)), evidence, Severity.INFO))
    return chosen, findings


def number_of(text: str) -> float:
    """Parse a number written by hand, with a decimal point or a decimal comma.

    Raises:
        ValueError: the text is not a number.
    """
    try:
        return float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
    except ValueError:
        raise ValueError(f"'{text}' is not a number; write it like 72.6") from None
