"""Tabulates a result's numbers for Excel, MATLAB, R and scripts, and writes them as an Excel workbook."""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.estimation.result.cycles import (
    UNITS,
    Kind,
    curves_by_stage,
    cycle_columns,
    phase_columns,
    spatiotemporal_columns,
)
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.estimation.simultaneous.instruments.instrument_errors import calibration_columns
from kinertia.io.versions import VERSION
from kinertia.motion.gait_cycle import PERCENT
from kinertia.report.exports.files import write_columns

Column = Sequence[Any] | np.ndarray
Table = Mapping[str, Column]
"""Columns of one length, by name."""
_CURVES: tuple[tuple[str, str, Kind], ...] = (
    ("_clinical", "Clinical angles", "clinical"),
    ("_joint_moment", "Joint moments", "joint_moment"),
    ("_angle", "Model angles", "angle"),
    ("_moment", "Model moments", "moment"),
    ("_power", "Joint powers", "power"),
    ("", "Ground forces", "force"),
)
"""Endings of quantities, the first that fits, with sheet and kind."""
_TITLES = {
    "spatiotemporal": "Spatiotemporal",
    "moment_peaks": "Peaks",
    "contact_phases": "Phases",
    "bsp": "Body segments",
    "calibration": "Calibration",
}
_NARROWEST = 10
"""Least width of a column, in letters."""
_NAMED_BY = ("quantity", "trial", "task", "side", "stride")


def person_tables(fit: Fit) -> dict[str, Table]:
    """Return tables of all trials together: body segment parameters, calibration, strides, curves over the cycle and
    other phases, peaks.
    """
    tables: dict[str, Table] = {"bsp": fit.bsp_columns()}
    if fit.posterior is not None:
        tables["calibration"] = calibration_columns(fit.posterior.calibration)
    if any(trial.strides for trial in fit.trials):
        tables["spatiotemporal"] = spatiotemporal_columns(fit.trials)
        tables["cycles"] = cycle_columns(fit.trials, fit.mass_kg)
        tables["cycles_literature"] = cycle_columns(fit.trials, fit.mass_kg, "literature")
    if any(trial.phases for trial in fit.trials):
        tables["contact_phases"] = phase_columns(curves_by_stage(fit.trials, fit.mass_kg, 0, ["estimate"])["estimate"])
    peaks = fit.peak_columns()
    return {**tables, "moment_peaks": peaks} if peaks["peak"] else tables


def trial_tables(fit: Fit, trial: TrialFit) -> dict[str, Table]:
    """Return tables over the time (s) of one trial: coordinates in degrees and m, joint moments in N m, forces in N."""
    names, turns = fit.skeleton.coordinates, fit.skeleton.rotational

    def over_time(values: np.ndarray) -> Table:
        return {"time_s": trial.time, **dict(zip(names, values.T, strict=True))}

    q = trial.motion.q
    tables = {"coordinates": over_time(np.where(turns, np.degrees(q), q))}
    tables |= {
        "moments" if stage == "estimate" else f"moments_{stage}": over_time(loads)
        for stage, loads in trial.joint_loads.items()
    }
    if trial.deviations is not None:
        of_coordinates = trial.deviations.coordinates
        tables["coordinates_sd"] = over_time(np.where(turns, np.degrees(of_coordinates), of_coordinates))
        tables["moments_sd"] = over_time(trial.deviations.moments)
    tables |= _joint_tables(trial)
    axes = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]
    residual = trial.residuals["estimate"]
    tables["residuals"] = {"time_s": trial.time, **dict(zip(axes, residual.T, strict=True))}
    return tables


def _joint_tables(trial: TrialFit) -> dict[str, Table]:
    """Return moments (N m) and forces (N) of the joints in three dimensions, wherever they are known; else NaN."""
    curves = trial.joint_curves
    if curves is None:
        return {}
    joints = curves.joints["estimate"]
    values = {"joint_moments": (joints.names, joints.moments), "joint_forces": (joints.force_names, joints.forces)}
    if curves.moment_sd is not None and curves.force_sd is not None:
        values["joint_moments_sd"] = joints.names, curves.moment_sd
        values["joint_forces_sd"] = joints.force_names, curves.force_sd
    return {
        table: {
            "time_s": curves.time,
            **dict(zip(names, values_of_joints.reshape(len(values_of_joints), -1).T, strict=True)),
        }
        for table, (names, values_of_joints) in values.items()
    }


def write_csv(fit: Fit, folder: Path) -> None:
    """Write one CSV file per table; those of a trial into a folder with its name."""
    for name, table in person_tables(fit).items():
        write_columns(folder / f"{name}.csv", table)
    for trial in fit.trials:
        (folder / trial.name).mkdir()
        for name, table in trial_tables(fit, trial).items():
            write_columns(folder / trial.name / f"{name}.csv", table)


def write_json(fit: Fit, path: Path) -> None:
    """Write one JSON file: tables by name, and under "trials" those of every trial; a gap is null."""
    tables: dict[str, Any] = {name: _lists(table) for name, table in person_tables(fit).items()}
    tables["trials"] = {
        trial.name: {name: _lists(table) for name, table in trial_tables(fit, trial).items()} for trial in fit.trials
    }
    path.write_text(json.dumps(tables, allow_nan=False) + "\n", encoding="utf-8")


def write_mat(fit: Fit, path: Path) -> None:
    """Write one MATLAB file: a struct per table with a field per column, and a struct array `trials`."""
    from scipy.io import savemat

    tables: dict[str, Any] = {name: _fields(table) for name, table in person_tables(fit).items()}
    tables["trials"] = [
        {"name": trial.name, **{name: _fields(table) for name, table in trial_tables(fit, trial).items()}}
        for trial in fit.trials
    ]
    savemat(path, tables, long_field_names=True, oned_as="column")


def _lists(table: Table) -> dict[str, list[Any]]:
    return {name: [plain(value) for value in cells(values)] for name, values in table.items()}


def cells(values: Column) -> list[Any]:
    """Return the values of a column as Python's own."""
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def plain(value: Any) -> Any:
    """Return a value, or None for a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _fields(table: Table) -> dict[str, Any]:
    """Return MATLAB fields: texts as rows of characters, a hundred times faster than cells (`cellstr` makes them),
    names as MATLAB allows. Missing values are an empty text or NaN.
    """
    fields = {}
    for name, values in table.items():
        texts = all(value is None or isinstance(value, str) for value in values)
        blank = "" if texts else math.nan
        filled = [blank if value is None else value for value in cells(values)]
        word = re.sub(r"\W", "_", name, flags=re.ASCII)
        fields[word if word[:1].isalpha() else f"x{word}"] = np.array(filled, dtype=str if texts else None)
    return fields


def write_xlsx(fit: Fit, path: Path) -> None:
    """Write a workbook. Sheets of curves have a row per percent of the gait cycle, and two columns per stride: values
    and standard deviations if there are any. What is not known is an empty cell. Columns are as wide as their words.
    """
    from openpyxl import Workbook
    from openpyxl.utils import get_column_letter

    book, tables = Workbook(write_only=True), person_tables(fit)

    def write(title: str, rows: Iterable[Sequence[Any]], below: str | None) -> None:
        sheet, written = book.create_sheet(title), [[plain(value) for value in row] for row in rows]
        sheet.freeze_panes = below
        for k, column in enumerate(zip(*written, strict=True)):
            longest = max((len(value) for value in column if isinstance(value, str)), default=0)
            sheet.column_dimensions[get_column_letter(k + 1)].width = max(_NARROWEST, longest + 2)
        for row in written:
            sheet.append(row)

    write("About", _about(fit), None)
    for name in ("spatiotemporal", "moment_peaks"):
        if name in tables:
            write(_TITLES[name], _rows(tables[name]), "A2")
    if "cycles" in tables:
        for ending, title, kind in _CURVES:
            if rows := list(_side_by_side(tables["cycles"], ending, UNITS[kind])):
                write(title, rows, f"B{len(_NAMED_BY) + 2}")
    for name in ("contact_phases", "bsp", "calibration"):
        if name in tables:
            write(_TITLES[name], _rows(tables[name]), "A2")
    book.save(path)


def _about(fit: Fit) -> Iterator[Sequence[Any]]:
    yield "Kinertia", VERSION
    yield "Person", fit.subject.name
    yield "Mass (kg)", fit.mass_kg
    yield "Verdict", fit.overview.line
    yield (
        "Curves",
        "One row per percent of the gait cycle, from heel strike to heel strike of the side named above the column.",
    )
    yield "SD", "Standard deviation; twice as much to either side is a 95 % interval. Empty where nothing is known."
    yield "Moments", "Internal, per body mass. hip_flexion is positive where it flexes; ankle_flexion is dorsiflexion."
    yield "Peaks", "Positive in the direction that their names state."


def _rows(table: Table) -> Iterator[Sequence[Any]]:
    yield list(table)
    yield from zip(*map(cells, table.values()), strict=True)


def _side_by_side(cycles: Table, ending: str, unit: str) -> Iterator[Sequence[Any]]:
    """Yield the rows of a sheet of curves: what each column is, line by line, then a row per percent."""
    named = {name: cells(cycles[name])[:: len(PERCENT)] for name in _NAMED_BY}
    chosen = [row for row, quantity in enumerate(named["quantity"]) if _ending(quantity) == ending]
    if not chosen:
        return
    values, sd = (np.reshape(np.asarray(cycles[name], dtype=float), (-1, len(PERCENT))) for name in ("value", "sd"))
    kinds = (unit, f"SD ({unit})") if np.isfinite(sd[chosen]).any() else (unit,)
    for name in _NAMED_BY:
        yield [name, *(named[name][row] for row in chosen for _ in kinds)]
    yield ["percent", *(cell for _ in chosen for cell in kinds)]
    columns = np.stack([values[chosen], sd[chosen]], axis=1)[:, : len(kinds)].reshape(-1, len(PERCENT))
    for percent, row in zip(cells(PERCENT), cells(columns.T), strict=True):
        yield [percent, *row]


def _ending(quantity: str) -> str:
    return next(ending for ending, _, _ in _CURVES if quantity.endswith(ending))
