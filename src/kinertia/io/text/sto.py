"""Reads and writes STO and MOT files: OpenSim's tables of columns over time."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinertia.errors import FileError, malformed, mismatch
from kinertia.findings.finding import Finding, with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.output_folder import write_then_rename
from kinertia.io.text.number_table import read_lines, read_rows
from kinertia.trial.data import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_ROW_KEYS = ("nrows", "datarows")
_COLUMN_KEYS = ("ncolumns", "datacolumns")


@dataclass(frozen=True)
class TimeTable:
    """Columns over time, in a file's own units.

    Attributes:
        time: (n,) s.
        labels: labels of the k columns.
        values: (n, k) values.
        in_degrees: whether its angles are in degrees; None where the file does not state it.
        findings: what was assumed while reading.
    """

    time: FloatArray
    labels: tuple[str, ...]
    values: FloatArray
    in_degrees: bool | None
    findings: tuple[Finding, ...] = ()

    def columns(self, labels: Sequence[str]) -> FloatArray:
        """Return the columns (n, c) of these labels."""
        return self.values[:, [self.labels.index(label) for label in labels]]


def read_sto(path: str | Path) -> pd.DataFrame:
    """Read a file as a pandas table indexed by time (s); `attrs["in_degrees"]` is that of `read_table`."""
    import pandas as pd

    time_table = read_table(path)
    table = pd.DataFrame(
        time_table.values, index=pd.Index(time_table.time, name="time"), columns=list(time_table.labels)
    )
    table.attrs["in_degrees"] = time_table.in_degrees
    return table


def read_table(path: str | Path) -> TimeTable:
    """Read the columns of a file.

    Raises:
        FileError: the file is missing or is not a complete, consistent STO or MOT file; with the line.
    """
    path = Path(path)
    lines = read_lines(path)
    end = next((number for number, line in enumerate(lines, start=1) if line.strip().lower() == "endheader"), None)
    if end is None:
        raise mismatch(path, "a STO or MOT file", "no line 'endheader'", "one at the end of the header")
    header = _header(lines[: end - 1])
    label_line = next((number for number in range(end + 1, len(lines) + 1) if lines[number - 1].strip()), None)
    if label_line is None:
        raise FileError.found(path, "F104", end, found=Quantity("it ends after 'endheader', without labels and rows"))
    labels = _labels(path, lines[label_line - 1], label_line)
    values, line_numbers = read_rows(path, lines, label_line + 1, len(labels))
    if not len(values):
        raise FileError.found(path, "F104", rows=Quantity(0, "1"), found=Quantity("no rows follow the column labels"))
    findings = _wrong_counts(path, header, len(values), len(labels))
    time = values[:, 0]
    if np.isnan(time).any():
        raise malformed(path, line_numbers[int(np.argmax(np.isnan(time)))], "a row without a time", "one in column 1")
    stated = header.get("indegrees")
    in_degrees = None if stated is None else stated[0].lower() == "yes"
    return TimeTable(time, tuple(labels[1:]), values[:, 1:], in_degrees, findings)


def write_sto(path: str | Path, table: pd.DataFrame, in_degrees: bool, name: str) -> None:
    """Write a pandas table indexed by time (s), as `write_table` does."""
    labels = tuple(map(str, table.columns))
    write_table(path, TimeTable(table.index.to_numpy(float), labels, table.to_numpy(float), in_degrees), name)


def write_table(path: str | Path, table: TimeTable, name: str, remark: str = "") -> None:
    """Write columns over time in the form that OpenSim 4 reads.

    Args:
        path: the file, `.sto` or `.mot`; it appears complete or not at all.
        table: table in the units of the file.
        name: first line of the file.
        remark: one line of the header for human readers, if any; no equals sign, which would make it a key.
    """
    labels = ["time", *table.labels]
    values = np.column_stack((table.time, table.values)).tolist()
    form = "\t".join(["%.17g"] * len(labels))
    lines = [
        name,
        "version=1",
        f"nRows={len(values)}",
        f"nColumns={len(labels)}",
        f"inDegrees={'yes' if table.in_degrees else 'no'}",
        *filter(None, [remark]),
        "endheader",
        "\t".join(labels),
        *(form % tuple(row) for row in values),
        "",
    ]
    write_then_rename(Path(path), "\n".join(lines))


def _header(lines: list[str]) -> dict[str, tuple[str, int]]:
    """Return header entries by lower-case key, each with its line; the forms are `key=value` and `key value`."""
    entries = {}
    for number, line in enumerate(lines, start=1):
        parts = line.replace("=", " ").split()
        if len(parts) == 2:
            entries[parts[0].lower()] = (parts[1], number)
    return entries


def _labels(path: Path, line: str, number: int) -> list[str]:
    cells = line.rstrip().split("\t") if "\t" in line.strip() else line.split()
    labels = [cell.strip() for cell in cells]
    if separated := re.match(r"time\s*([,;])", labels[0].lower()):
        raise header_entry(path, number, "the character between columns", f"'{separated[1]}'", "a tab")
    if labels[0].lower() != "time":
        raise header_entry(path, number, "the first column", f"'{labels[0]}'", "'time'")
    if "" in labels:
        raise header_entry(path, number, f"the label of column {labels.index('') + 1}", "missing", "a name")
    expect_once(path, labels, number)
    return labels


def header_entry(path: Path, line: int | None, key: str, value: str, expected: str) -> FileError:
    """Return the error that {key} in the header is {value}, expected {expected}."""
    return FileError.found(path, "F114", line, key=Quantity(key), value=Quantity(value), expected=Quantity(expected))


def expect_once(path: Path, labels: Sequence[str], line: int | None) -> None:
    """Raise a FileError that lists the labels that occur more than once."""
    repeated = {label: count for label, count in Counter(labels).items() if count > 1}
    if repeated:
        names = Quantity(", ".join(repeated))
        raise FileError.found(path, "F113", line, count=Quantity(max(repeated.values()), "1"), label=names)


def _wrong_counts(path: Path, header: dict[str, tuple[str, int]], rows: int, columns: int) -> tuple[Finding, ...]:
    """Find counts in the header that the file contradicts: not an error, since rows decide (as in OpenSim)."""
    return tuple(
        other_count(path, line, float(stated) if stated.isdecimal() else stated, count, what)
        for keys, count, what in ((_ROW_KEYS, rows, "rows"), (_COLUMN_KEYS, columns, "columns"))
        for stated, line in (header[key] for key in keys if key in header)
        if not stated.isdecimal() or int(stated) != count
    )


def other_count(path: Path, line: int | None, announced: float | str, found: int, what: str) -> Finding:
    """Return a finding on the count that a header announces and the count in the file."""
    unit = "" if isinstance(announced, str) else "1"
    counts = {"announced": Quantity(announced, unit), "found": Quantity(found, "1")}
    return with_evidence("F111", Where(path.name, line), {**counts, "what": Quantity(what)})
