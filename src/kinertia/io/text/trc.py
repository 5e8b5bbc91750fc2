"""Reads and writes TRC files: marker trajectories as text."""

import math
import re
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from kinertia.errors import FileError, malformed, mismatch
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.io.output_folder import write_then_rename
from kinertia.io.text.number_table import (
    most_seen,
    read_lines,
    read_rows,
    rounding_s,
    times_rounded,
    uneven,
    without_prefixes,
)
from kinertia.io.text.sto import header_entry, other_count
from kinertia.trial.data import BoolArray, FloatArray, Markers, Recording

RATE_ERROR = Limit(0.01)
"""By which the header's rate may differ from that of the time column."""
METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001}

_HEADER_KEYS = ("DataRate", "NumFrames", "NumMarkers", "Units")
_FIRST_ROW_LINE = 6
_TIME_TOLERANCE_FRAMES, _TIME_TOLERANCE_S = 0.25, 1e-6
_SHOWN = 40
_STAND_INS = {"0 0 0": (0.0,), "-9999 -9999 -9999": (-9999.0, -9.999)}


def read_trc(path: str | Path) -> Markers:
    """Read marker trajectories (m, ground axes as in the file) from a TRC file.

    Empty cells, NaN and the triples 0 0 0 and -9999 -9999 -9999 are missing markers; `subject:` before the labels is
    removed; of repeated labels the one in most frames is kept. Frame times that were rounded when written are put back
    on the uniform grid they came from. `read_trc_recording` reports what was assumed.

    Raises:
        FileError: the file is missing or is not a complete, consistent TRC file; with the line.
    """
    return read_trc_recording(path).markers


def read_trc_recording(path: str | Path) -> Recording:
    """Read markers as `read_trc` does, with the file's unit and findings about assumptions; Y is assumed to point
    up."""
    path = Path(path)
    lines = read_lines(path)
    header = _header(path, lines)
    count = _count(path, header, "NumMarkers")
    labels = _labels(path, lines, count)
    lines = _without_leading_tab(lines, 2 + 3 * len(labels))
    findings = _other_markers(path, lines, labels, count)
    values, line_numbers = read_rows(path, lines, _first_row(lines), 2 + 3 * len(labels), may_be_short=True)
    frames = _count(path, header, "NumFrames")
    _expect_whole(path, lines, len(values), frames, line_numbers[-1] if line_numbers else 3, 2 + 3 * len(labels))
    if len(values) != frames:
        findings.append(other_count(path, 3, frames, len(values), "frames"))
    time, time_findings = _uniform_time(path, values[:, 1], line_numbers, _number(path, header, "DataRate"))
    positions, position_findings = seen_positions(path, values[:, 2:], labels, line_numbers)
    unit = header["Units"].lower()
    if unit not in METRES_PER_UNIT:
        raise unknown_unit(path, "lengths", f"'{header['Units']}'", line=3)
    names, prefix_findings = without_prefixes(path, labels)
    if len(set(names)) == len(set(labels)):
        labels, findings = tuple(names), [*findings, *prefix_findings]
    chosen, repeated = most_seen(path, labels, np.asarray(np.isfinite(positions).all(axis=2)))
    markers = Markers(time, tuple(chosen), positions[:, list(chosen.values())] * METRES_PER_UNIT[unit])
    found = (*findings, *repeated, *time_findings, *position_findings)
    return Recording(path.stem, markers, findings=found, length_unit=unit)


def unknown_unit(
    path: Path,
    what: str,
    unit: str,
    expected: str = "mm, cm or m",
    line: int | None = None,
    known: Mapping[str, Quantity] | None = None,
) -> FileError:
    """Return the error that the unit of {what} is {unit}, expected {expected}."""
    words = {"unit": Quantity(unit), "what": Quantity(what), "expected": Quantity(expected)}
    return FileError.found(path, "F121", line, **(known or {}), **words)


def write_trc(path: str | Path, markers: Markers) -> None:
    """Write marker trajectories as a TRC file in mm (to 1e-6 mm) that OpenSim reads; a missing marker is NaN.

    Raises:
        ValueError: a label contains a tab or line end, which TRC cannot hold.
    """
    path = Path(path)
    if any(set(label) & set("\t\r\n") or not label.strip() for label in markers.labels):
        raise ValueError("TRC labels must not be blank or contain tabs or line ends")
    n, m = len(markers.time), len(markers.labels)
    rate = f"{markers.rate_hz if n > 1 else 1.0:.10g}"
    rows = np.column_stack((markers.time, 1000.0 * markers.positions.reshape(n, 3 * m)))
    form = "%d\t%.9f" + "\t%.6f" * (3 * m)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{n}\t{m}\tmm\t{rate}\t1\t{n}",
        "Frame#\tTime\t" + "\t\t\t".join(markers.labels) + "\t\t",
        "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in range(1, m + 1)),
        "",
        *(form % (frame, *row) for frame, row in enumerate(rows.tolist(), start=1)),
        "",
    ]
    write_then_rename(path, "\n".join(lines))


def header_frames(path: Path) -> int:
    """Return the number of frames in the header of a TRC file.

    Raises:
        FileError: it is not a TRC file.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        lines = list(islice(stream, _FIRST_ROW_LINE))
    if not lines:
        raise FileError.found(path, "F104", found=Quantity("it is empty"))
    return _count(path, _header(path, lines), "NumFrames")


def _header(path: Path, lines: list[str]) -> dict[str, str]:
    if not lines[0].lstrip().startswith("PathFileType"):
        raise mismatch(path, "a TRC file", f"'{lines[0].strip()[:_SHOWN]}'", "'PathFileType'", 1)
    if len(lines) < _FIRST_ROW_LINE:
        counted = {"lines": Quantity(len(lines), "1")}
        found = Quantity(f"it ends within its header, after {len(lines)} lines")
        raise FileError.found(path, "F104", len(lines), **counted, found=found)
    names, values = lines[1].split(), lines[2].split()
    missing = [key for key in _HEADER_KEYS if key not in names]
    if missing:
        raise header_entry(path, 2, ", ".join(missing), "missing", "one value of each")
    if len(values) != len(names):
        raise header_entry(path, 3, "the row of values", f"{len(values)} long", f"{len(names)}, one for each name")
    return dict(zip(names, values, strict=True))


def _number(path: Path, header: dict[str, str], key: str) -> float:
    try:
        number = float(header[key])
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise header_entry(path, 3, key, f"'{header[key]}'", "a number")
    return number


def _count(path: Path, header: dict[str, str], key: str) -> int:
    number = _number(path, header, key)
    if number < 0 or number != int(number):
        raise header_entry(path, 3, key, f"'{header[key]}'", "a whole number")
    return int(number)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in (line.split("\t") if "\t" in line else line.split())]


def _labels(path: Path, lines: list[str], count: int) -> tuple[str, ...]:
    """Return the labels; where no tabs separate them, two or more blanks do, or single ones if that makes as many as
    the header announces.
    """
    line = lines[3].strip()
    ways = (line.split("\t"), re.split(r"\t|\s{2,}", line), line.split())
    by_tab, *by_blanks = (tuple(cell.strip() for cell in cells if cell.strip())[2:] for cells in ways)
    labels = by_tab or next((split for split in by_blanks if len(split) == count), by_blanks[-1])
    if not labels:
        raise FileError.found(path, "F164", 4, found=Quantity("the row of labels is empty"))
    return labels


def _without_leading_tab(lines: list[str], columns: int) -> list[str]:
    """Return the lines without the tab before each row that some programs write, which makes a cell too many."""
    first = _first_row(lines) - 1
    rows = [line.rstrip() for line in lines[first:] if line.strip()]
    if not all(row.startswith("\t") for row in rows) or not any(row.count("\t") == columns for row in rows):
        return lines
    return [*lines[:first], *(line.removeprefix("\t") for line in lines[first:])]


def _expect_whole(path: Path, lines: list[str], rows: int, frames: int, line: int, columns: int) -> None:
    """Raise a FileError about a file without rows, or one that ends within a row and before its last frame."""
    found = f"it has {rows} of the {frames} frames that its header announces"
    if rows and not (rows < frames and len(lines[line - 1].split("\t")) < columns):
        return
    if rows:
        found = f"it ends within a row, and {found.removeprefix('it ')}"
    counts = {"rows": Quantity(rows, "1"), "announced": Quantity(frames, "1")}
    raise FileError.found(path, "F104", line, **counts, found=Quantity(found))


def _other_markers(path: Path, lines: list[str], labels: tuple[str, ...], count: int) -> list[Finding]:
    """Find a header whose number of markers differs from the labels and the columns of numbers, which agree.

    Raises:
        FileError: labels and columns do not agree either, so that labels cannot be assigned.
    """
    if len(labels) == count:
        return []
    rows = lines[_first_row(lines) :]
    columns = max((len(_cells(row.rstrip())) for row in rows), default=0)
    if columns != 2 + 3 * len(labels):
        counts = {"labels": Quantity(len(labels), "1"), "columns": Quantity(columns, "1")}
        raise FileError.found(path, "F112", 4, **counts, announced=Quantity(count, "1"))
    return [other_count(path, 3, count, len(labels), "markers")]


def _first_row(lines: list[str]) -> int:
    """Return the one-based line of the first row: line 5 is X1 Y1 Z1 ..., but some writers leave it out."""
    return _FIRST_ROW_LINE if lines[4].strip()[:1].upper() in ("X", "") else _FIRST_ROW_LINE - 1


def _uniform_time(
    path: Path, time: FloatArray, line_numbers: list[int], rate_hz: float
) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Return times on an exactly uniform grid; DataRate gives the step where rounding explains the times."""
    _expect_even_steps(path, time, line_numbers)
    if len(time) == 1:
        return time, ()
    step = (time[-1] - time[0]) / (len(time) - 1)
    at_rate = time[0] + np.arange(len(time)) / rate_hz if rate_hz > 0 else np.full(len(time), np.inf)
    # three frames at 60 Hz, told to the millisecond, run at 60.6 Hz by their ends
    if abs(rate_hz * step - 1) > RATE_ERROR and np.abs(time - at_rate).max() > rounding_s(time):
        rates = {"header_hz": Quantity(rate_hz, "Hz"), "column_hz": Quantity(float(1 / step), "Hz")}
        raise FileError.found(path, "T103", 3, **rates)
    frames = np.arange(len(time))
    uniform = time[0] + frames / rate_hz
    if np.abs(time - uniform).max() > max(1.01 * rounding_s(time), _TIME_TOLERANCE_S):
        uniform = time[0] + frames * step
    error = np.abs(time - uniform)
    if error.max() > _TIME_TOLERANCE_FRAMES * step:
        row = int(np.argmax(error))
        raise uneven(path, line_numbers[row], time[row - 1], time[row], step)
    if error.max() <= 1e-9:
        return time, ()
    rounded = times_rounded(path, error.max(), 1 / (uniform[1] - uniform[0]))
    return uniform, ((rounded,) if error.max() > 1e-6 else ())


def _expect_even_steps(path: Path, time: FloatArray, line_numbers: list[int]) -> None:
    if np.isnan(time).any():
        row = int(np.argmax(np.isnan(time)))
        raise malformed(path, line_numbers[row], "a row without a time", "one in column 2")
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else 0.0
    back = np.flatnonzero(steps <= 0)
    odd = back if back.size else np.flatnonzero(np.abs(steps - usual) > 0.5 * usual)
    if odd.size:
        row = int(odd[0]) + 1
        raise uneven(path, line_numbers[row], time[row - 1], time[row], usual)


def seen_positions(
    path: Path, values: FloatArray, labels: tuple[str, ...], line_numbers: list[int]
) -> tuple[FloatArray, list[Finding]]:
    """Return positions (n, m, 3) from rows of x, y, z of every marker, NaN where missing or a placeholder (F115)."""
    positions = values.reshape(len(values), len(labels), 3)
    absent = np.isnan(positions)
    partly = np.argwhere(absent.any(axis=2) & ~absent.all(axis=2))
    if partly.size:
        row, marker = partly[0]
        found = f"one or two coordinates of marker {labels[marker]}"
        known = {"marker": Quantity(labels[marker])}
        raise malformed(path, line_numbers[row], found, "all three of them, or none", **known)
    stood_in = stand_ins(positions)
    for where in stood_in.values():
        positions[where] = np.nan
    return positions, read_as_missing(path, labels, stood_in)


def read_as_missing(path: Path, labels: Sequence[str], stood_in: Mapping[str, BoolArray]) -> list[Finding]:
    """Report positions (n, m) that were placeholders for a missing marker, by kind of placeholder."""
    return [
        finding(
            "F115",
            Where(path.name, markers=tuple(label for k, label in enumerate(labels) if where[:, k].any())),
            count=Quantity(int(where.sum()), "1"),
            written=Quantity(written),
        )
        for written, where in stood_in.items()
        if where.any()
    ]


def stand_ins(positions: FloatArray) -> dict[str, BoolArray]:
    """Find placeholders (n, m) for missing markers among positions (n, m, 3) in a file's unit, by kind.

    -9999 became -9.999 where millimetres were written as metres.
    """
    found = {}
    for name, numbers in _STAND_INS.items():
        hits = [np.isclose(positions, number, rtol=1e-6, atol=0.0).all(axis=2) for number in numbers]
        found[name] = np.asarray(np.any(hits, axis=0))
    return found
