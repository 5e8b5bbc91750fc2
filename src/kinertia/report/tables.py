"""Makes all tables of a result's numbers: for Excel, MATLAB, R and scripts."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.estimation.cycles import curves_by_stage, cycle_columns, phase_columns, spatiotemporal_columns
from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.calibration_entry import calibration_columns
from kinertia.estimation.trial_fit import TrialFit
from kinertia.report.files import write_columns

Column = Sequence[Any] | np.ndarray
Table = Mapping[str, Column]
"""Columns of one length, by name."""


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
        table: {"time_s": curves.time, **dict(zip(names, each.reshape(len(each), -1).T, strict=True))}
        for table, (names, each) in values.items()
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
