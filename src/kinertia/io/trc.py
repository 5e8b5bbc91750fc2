"""TRC files: marker trajectories as text, as Motion Analysis defined them and OpenSim uses them."""

from __future__ import annotations

import math
from collections import Counter
from itertools import islice
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.io.even_times import rounding_s
from kinertia.io.number_table import read_lines, read_rows
from kinertia.io.output_folder import write_then_rename
from kinertia.io.subject_prefix import without_prefixes
from kinertia.trial.data import BoolArray, FloatArray, Markers, Recording

METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001}

_HEADER_KEYS = ("DataRate", "NumFrames", "NumMarkers", "Units")
_FIRST_ROW_LINE = 6
_TIME_TOLERANCE_FRAMES = 0.25
_STAND_INS = {"0 0 0": (0.0,), "-9999 -9999 -9999": (-9999.0, -9.999)}


def read_trc(path: str | Path) -> Markers:
    """Read marker trajectories (m, ground axes as in the file) from a TRC file.

    Empty cells, NaN and the triples 0 0 0 and -9999 -9999 -9999 are missing markers; `subject:` before the labels is
    taken off. Frame times that were rounded when written are put back on the uniform grid they came from.
    `read_trc_recording` tells what was needed.

    Raises:
        FileError: the file is missing or is not a complete, consistent TRC file; with the line.
    """
    return read_trc_recording(path).markers


def read_trc_recording(path: str | Path) -> Recording:
    """`read_trc` with the file's unit and the assumptions made while reading; Y is taken to point up."""
    path = Path(path)
    lines = read_lines(path)
    header = _header(path, lines)
    labels = _labels(path, lines)
    label_notes = _label_notes(path, lines, labels, _count(path, header, "NumMarkers"))
    values, line_numbers = read_rows(path, lines, _first_row(lines), 2 + 3 * len(labels), may_be_short=True)
    frames = _count(path, header, "NumFrames")
    if not len(values):
        raise FileError(path, f"the header announces {frames} frames but the file has 0; export the file again", 3)
    last = lines[line_numbers[-1] - 1].split("\t")
    if len(values) < frames and len(last) < 2 + 3 * len(labels):
        raise FileError(
            path,
            f"ends in the middle of a row, and has {len(values)} of the {frames} frames that its header announces: a "
            "part of it is lost; copy or export the file again",
            line_numbers[-1],
        )
    counted = f"{path.name}: its header announces {frames} frames, the file has {len(values)}: all of them were read"
    count_notes = () if len(values) == frames else (counted,)
    time, time_notes = _uniform_time(path, values[:, 1], line_numbers, _number(path, header, "DataRate"))
    positions, position_notes = seen_positions(path, values[:, 2:], labels, line_numbers)
    unit = header["Units"].lower()
    if unit not in METRES_PER_UNIT:
        raise FileError(path, f"unknown unit '{header['Units']}'; expected mm, cm or m after Units", 3)
    names, prefix_notes = without_prefixes(path, labels)
    if len(set(names)) == len(names):
        labels, label_notes = tuple(names), (*label_notes, *prefix_notes)
    markers = Markers(time, labels, positions * METRES_PER_UNIT[unit])
    notes = (*label_notes, *count_notes, *time_notes, *position_notes)
    return Recording(path.stem, markers, notes=notes, length_unit=unit)


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
    """Frames that the header of a TRC file announces.

    Raises:
        FileError: it is none.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        lines = list(islice(stream, _FIRST_ROW_LINE))
    if not lines:
        raise FileError(path, "the file is empty; export it again")
    return _count(path, _header(path, lines), "NumFrames")


def _header(path: Path, lines: list[str]) -> dict[str, str]:
    if not lines[0].lstrip().startswith("PathFileType"):
        raise FileError(path, "not a TRC file: expected it to begin with 'PathFileType'; check what was exported", 1)
    if len(lines) < _FIRST_ROW_LINE:
        raise FileError(path, f"ends within its header after {len(lines)} lines; export it again", len(lines))
    names, values = lines[1].split(), lines[2].split()
    missing = [key for key in _HEADER_KEYS if key not in names]
    if missing:
        raise FileError(path, f"the header lacks {', '.join(missing)}; export the file again", 2)
    if len(values) != len(names):
        raise FileError(path, f"{len(values)} values for {len(names)} header names; export the file again", 3)
    return dict(zip(names, values, strict=True))


def _number(path: Path, header: dict[str, str], key: str) -> float:
    try:
        number = float(header[key])
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise FileError(path, f"{key} is '{header[key]}', expected a number; export the file again", 3)
    return number


def _count(path: Path, header: dict[str, str], key: str) -> int:
    number = _number(path, header, key)
    if number < 0 or number != int(number):
        raise FileError(path, f"{key} is {header[key]}, expected a whole number; export the file again", 3)
    return int(number)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in (line.split("\t") if "\t" in line else line.split())]


def _labels(path: Path, lines: list[str]) -> tuple[str, ...]:
    labels = tuple(cell for cell in _cells(lines[3]) if cell)[2:]
    if not labels:
        raise FileError(path, "no marker labels; export it again", 4)
    repeated = [label for label, times in Counter(labels).items() if times > 1]
    if repeated:
        raise FileError(
            path,
            f"repeated marker labels {', '.join(repeated)}; expected each once, rename or remove the others",
            4,
        )
    return labels


def _label_notes(path: Path, lines: list[str], labels: tuple[str, ...], count: int) -> tuple[str, ...]:
    """A sentence where the header counts other markers than the labels and the columns of numbers, which agree.

    Raises:
        FileError: labels and columns do not agree either, so that nobody knows which label is whose.
    """
    if len(labels) == count:
        return ()
    rows = lines[_first_row(lines) :]
    columns = max((len(_cells(row.rstrip())) for row in rows), default=0)
    if columns != 2 + 3 * len(labels):
        raise FileError(
            path, f"{len(labels)} marker labels, expected {count} as NumMarkers says; correct or export it again", 4
        )
    return (f"{path.name}: its header announces {count} markers, the file has {len(labels)}: all of them were read",)


def _first_row(lines: list[str]) -> int:
    """One-based line of the first row: line 5 is X1 Y1 Z1 ..., but some writers leave it out."""
    return _FIRST_ROW_LINE if lines[4].strip()[:1].upper() in ("X", "") else _FIRST_ROW_LINE - 1


def _uniform_time(
    path: Path, time: FloatArray, line_numbers: list[int], rate_hz: float
) -> tuple[FloatArray, tuple[str, ...]]:
    """Times on an exactly uniform grid; DataRate gives the step, or the time column where that fits better."""
    _expect_even_steps(path, time, line_numbers)
    if len(time) == 1:
        return time, ()
    step = (time[-1] - time[0]) / (len(time) - 1)
    at_rate = time[0] + np.arange(len(time)) / rate_hz if rate_hz > 0 else np.full(len(time), np.inf)
    # three frames at 60 Hz, told to the millisecond, run at 60.6 Hz by their ends
    if abs(rate_hz * step - 1) > 0.01 and np.abs(time - at_rate).max() > rounding_s(time):
        problem = f"DataRate is {rate_hz:g} Hz but the time column runs at {1 / step:.6g} Hz"
        raise FileError(path, f"{problem}; correct the wrong one", 3)
    frames = np.arange(len(time))
    uniform = time[0] + frames / rate_hz
    if np.abs(time - uniform).max() > _TIME_TOLERANCE_FRAMES * step:
        uniform = time[0] + frames * step
    error = np.abs(time - uniform)
    if error.max() > _TIME_TOLERANCE_FRAMES * step:
        row = int(np.argmax(error))
        problem = f"time {time[row]:g} s, expected {uniform[row]:g} s for equal steps of {step:.6g} s"
        raise FileError(path, f"{problem}; Kinertia needs a constant frame rate, export one", line_numbers[row])
    if error.max() <= 1e-9:
        return time, ()
    note = (
        f"{path.name}: frame times are rounded by up to {1000 * error.max():.2g} ms; the uniform times of "
        f"{1 / (uniform[1] - uniform[0]):.6g} Hz were taken instead"
    )
    return uniform, ((note,) if error.max() > 1e-6 else ())


def _expect_even_steps(path: Path, time: FloatArray, line_numbers: list[int]) -> None:
    if np.isnan(time).any():
        row = int(np.argmax(np.isnan(time)))
        raise FileError(path, "the row has no time; expected it in column 2", line_numbers[row])
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else 0.0
    back = np.flatnonzero(steps <= 0)
    odd = back if back.size else np.flatnonzero(np.abs(steps - usual) > 0.5 * usual)
    if odd.size:
        row = int(odd[0]) + 1
        problem = f"time goes from {time[row - 1]:g} s to {time[row]:g} s where its step is {usual:g} s"
        raise FileError(path, f"{problem}; expected every frame, export gaps as empty cells", line_numbers[row])


def seen_positions(
    path: Path, values: FloatArray, labels: tuple[str, ...], line_numbers: list[int]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Positions (n, m, 3) of rows of x, y, z of every marker, NaN where these are missing or stand for it, notes."""
    positions = values.reshape(len(values), len(labels), 3)
    absent = np.isnan(positions)
    partly = np.argwhere(absent.any(axis=2) & ~absent.all(axis=2))
    if partly.size:
        row, marker = partly[0]
        raise FileError(
            path,
            f"marker {labels[marker]} has only some of its three coordinates; expected all or none, repair the row",
            line_numbers[row],
        )
    notes = []
    for what, where in stand_ins(positions).items():
        positions[where] = np.nan
        if where.any():
            named = ", ".join(label for k, label in enumerate(labels) if where[:, k].any())
            notes.append(f"{path.name}: {where.sum()} marker positions {what} were taken as missing ({named})")
    return positions, tuple(notes)


def stand_ins(positions: FloatArray) -> dict[str, BoolArray]:
    """Where (n, m) positions (n, m, 3) in a file's unit only stand for a missing marker, by what they are there.

    -9999 became -9.999 where millimetres were written as metres.
    """
    found = {}
    for name, numbers in _STAND_INS.items():
        hits = [np.isclose(positions, number, rtol=1e-6, atol=0.0).all(axis=2) for number in numbers]
        found[name] = np.asarray(np.any(hits, axis=0))
    return found
