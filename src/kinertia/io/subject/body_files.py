"""Reads and writes tables of a body: parameters of an earlier estimate, girths and lengths."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.text.csv_file import has_columns, read_csv
from kinertia.model.bsp import PARAMETERS, UNITS
from kinertia.model.stadium_body import Measure, measures

COLUMNS = ("measure", "level", "what", "cm", "sd_cm", "first")
_NEEDED = ("measure", "cm")
LONGEST_CM, SHORTEST_CM = 250.0, 1.0
_COLUMNS = ("segment", "parameter", "unit", "estimate", "sd")


@dataclass(frozen=True, eq=False)
class BodyMeasures:
    """Girths and lengths measured of a person.

    Attributes:
        name: name of the file.
        values: value and SD (m) by name of the measure.
    """

    name: str
    values: Mapping[str, tuple[float, float]]


def measures_sheet() -> str:
    """Write the empty sheet: one row per measure, the most informative for their time first."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for measure in sorted(measures(), key=lambda measure: not measure.first):
        table.writerow(
            [measure.name, measure.level, measure.what, "", f"{100 * measure.sd_m:g}", "yes" if measure.first else ""]
        )
    return text.getvalue()


def is_measures_sheet(path: Path) -> bool:
    """Return whether a file is such a sheet, filled in or not."""
    return has_columns(path, _NEEDED)


def read_measures(path: Path) -> BodyMeasures:
    """Read a sheet. Rows without a value were not measured; an SD that was removed is the sheet's own.

    Raises:
        FileError: no such file, an unknown measure or one twice, no value at all, or an impossible one; with the line.
    """
    known = {measure.name: measure for measure in measures()}
    values: dict[str, tuple[float, float]] = {}
    for row in read_csv(path, _NEEDED, "the sheet of kinertia init --measures"):
        name = row.cells["measure"]
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"the nearest is '{near[0]}'" if near else "kinertia init --measures writes a sheet with all"
            raise _wrong_measure(path, row.line, name, f"no such measure; {hint}")
        if not row.cells["cm"]:
            continue
        if name in values:
            raise _wrong_measure(path, row.line, name, "it is there twice")
        values[name] = (
            _length_m(path, row.line, known[name], row.number("cm")),
            (row.number("sd_cm") / 100.0 if row.cells.get("sd_cm") else known[name].sd_m),
        )
        if not values[name][1] > 0.0:
            raise _wrong_measure(path, row.line, name, "its sd must be positive")
    if not values:
        problem = "no value in the column cm; fill in what was measured, or leave measures out of [prior]"
        raise _wrong_measure(path, None, "the sheet", problem)
    return BodyMeasures(path.name, values)


def _length_m(path: Path, line: int, measure: Measure, value_cm: float) -> float:
    if SHORTEST_CM <= value_cm <= LONGEST_CM:
        return value_cm / 100.0
    problem = f"{value_cm:g} cm; expected {SHORTEST_CM:g} to {LONGEST_CM:g} cm"
    if value_cm > 0.0:
        problem += f" (was it in {'m' if value_cm < SHORTEST_CM else 'mm'}?)"
    raise _wrong_measure(
        path, line, measure.name, problem, value_m=Quantity(value_cm / 100.0, "m", limit=LONGEST_CM / 100.0)
    )


def _wrong_measure(path: Path, line: int | None, measure: str, problem: str, **evidence: Quantity) -> FileError:
    words = {"measure": Quantity(measure), "problem": Quantity(problem)}
    return FileError.found(path, "F182", line, **(evidence | words))


@dataclass(frozen=True, eq=False)
class BspTable:
    """Estimates of body segment parameters with their SDs.

    Attributes:
        name: name of the file.
        segments: segments in the file's order.
        estimate, sd: (s, 10) in the order of `PARAMETERS`, SI; SDs of a fixed segment are all zero.
    """

    name: str
    segments: tuple[str, ...]
    estimate: np.ndarray
    sd: np.ndarray


def read_bsp(path: Path) -> BspTable:
    """Read a file as `kinertia fit` writes it: one row per segment and parameter.

    Columns segment, parameter, unit, estimate and sd are needed, others are ignored.

    Raises:
        FileError: no such file, a column or a parameter is missing, or a value is not a number; with the line.
    """
    values: dict[str, dict[str, tuple[float, float]]] = {}
    without_sd: dict[str, dict[str, int]] = {}
    for row in read_csv(path, _COLUMNS, "the bsp.csv of a simultaneous fit"):
        line, segment, parameter, written_unit = row.line, *(row.cells[name] for name in _COLUMNS[:3])
        if parameter not in PARAMETERS:
            raise _wrong_parameter(
                path, line, segment, parameter, f"no such parameter; expected one of {', '.join(PARAMETERS)}"
            )
        unit = UNITS[PARAMETERS.index(parameter)]
        if written_unit != unit:
            raise _wrong_parameter(path, line, segment, parameter, f"its unit is '{written_unit}'; expected {unit}")
        if parameter in values.setdefault(segment, {}):
            raise _wrong_parameter(path, line, segment, parameter, "it is there twice")
        values[segment][parameter] = row.number("estimate"), row.number("sd")
        if not values[segment][parameter][1] > 0.0:
            without_sd.setdefault(segment, {})[parameter] = line
    for segment, known in values.items():
        if lacking := [name for name in PARAMETERS if name not in known]:
            raise _wrong_parameter(path, None, segment, ", ".join(lacking), "missing")
    for segment, lines in without_sd.items():
        parameter, line = next(iter(lines.items()))
        if any(sd != 0.0 for _, sd in values[segment].values()):
            raise _wrong_parameter(path, line, segment, parameter, "its sd must be positive")
    table = np.array([[known[name] for name in PARAMETERS] for known in values.values()])
    return BspTable(path.name, tuple(values), table[..., 0], table[..., 1])


def _wrong_parameter(path: Path, line: int | None, segment: str, parameter: str, problem: str) -> FileError:
    words = {"parameter": Quantity(parameter), "problem": Quantity(problem)}
    return FileError.found(path, "F183", line, Where(part=segment), **words)
