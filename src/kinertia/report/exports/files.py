"""Writes a `Fit` to a folder: the report, the result to open again, tables, and files that OpenSim opens.

Everything is written to a hidden folder first and moved when complete, so a run never leaves half a result.
"""

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.estimation.result.drawn_fit import chosen_draws, drawn_fit
from kinertia.estimation.result.fit import Fit
from kinertia.io.output_folder import complete_folder, expect_own_folder, write_then_rename
from kinertia.io.text.csv_file import inert
from kinertia.io.text.sto import write_table
from kinertia.report.exports.contents import FitContent, Model, TrialContent, model_of, opensim_content
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit

FIT_FILES = ("fit.json", FIT_FILE, "report.html", "bsp.csv", "model.osim")
"""Names of results that every fit has."""
TRIAL_FILES = ("kinematics.mot", "ground_reactions.mot", "external_loads.xml", "inverse_dynamics.sto", "residuals.sto")
"""Names of results that every trial has."""
_ALL_DIGITS, _SIX_DIGITS = "%r", "%.6g"


def save_fit(content: FitContent, folder: str | Path, force: bool = False) -> Path:
    """Write all result files of a fit into a folder, which is made if necessary, and return the folder.

    With one trial its files are in the folder itself, with several in a sub-folder per trial.

    Args:
        content: of the files, as `content_of` computes it.
        folder: folder to write to.
        force: write also among files that are not results of Kinertia; a file with the name of a result is refused.

    Raises:
        FileError: the folder holds such files, or cannot be written to.
    """
    if not force:
        expect_own_folder(folder, ", or force=True to write among them")
    with complete_folder(folder, "fit") as work:
        (work / "fit.json").write_text(json.dumps(content.summary, indent=2) + "\n", encoding="utf-8")
        (work / "report.html").write_text(content.report, encoding="utf-8")
        for name, columns in content.tables.items():
            write_columns(work / name, columns, _ALL_DIGITS if name == "bsp.csv" else _SIX_DIGITS)
        _write_model(content.model, work)
        for trial in content.trials:
            into = work if len(content.trials) == 1 else work / trial.name
            into.mkdir(exist_ok=True)
            _write_trial(trial, into)
        write_fit(content.fit, content.provenance, work / FIT_FILE, content.truth)
    return Path(folder)


def _write_trial(trial: TrialContent, folder: Path) -> None:
    for name, (table, remark) in trial.series.items():
        write_table(folder / name, table, name.partition(".")[0], remark)
    write_then_rename(folder / "external_loads.xml", trial.external_loads)


def write_columns(path: Path, columns: Mapping[str, Sequence[Any] | np.ndarray], digits: str = _ALL_DIGITS) -> None:
    """Write a table as pandas would: a cell without a number is empty.

    Args:
        path: the file.
        columns: columns by name.
        digits: format of numbers that are not integers.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(values, digits) for values in columns.values()), strict=True))


def _cells(values: Sequence[Any] | np.ndarray, digits: str) -> list[Any]:
    """Return the cells of a column as written to the file."""
    cells = values.tolist() if isinstance(values, np.ndarray) else list(values)
    kinds = set(map(type, cells))
    if all(issubclass(kind, float) for kind in kinds):
        texts = (" ".join([digits] * len(cells)) % tuple(cells)).split()
        return [None if text == "nan" else text for text in texts] if "nan" in texts else texts
    if all(issubclass(kind, str) for kind in kinds):  # names, of which long tables have few
        words = {cell: inert(cell) for cell in set(cells)}
        return [words[cell] for cell in cells]
    if kinds == {int}:
        return cells
    return [None if cell != cell else inert(cell) for cell in cells]


def _write_model(model: Model, folder: Path) -> None:
    (folder / "model.osim").write_bytes(model.osim)
    if model.changes is not None:
        changes = model.changes.map(inert)
        changes.to_csv(folder / "model_changes.csv", index=False, lineterminator="\n")


def write_draws(fit: Fit, folder: Path, count: int, seed: int = 0) -> None:
    """Write `count` posterior draws, each into a sub-folder: `draw_001`, `draw_002` ...

    Each holds `model.osim`, `kinematics.mot`, `ground_reactions.mot` and `external_loads.xml`; with several trials the
    last three are in a folder per trial, and all share the model. The SD of another program's results over the draws is
    the posterior SD of its result.

    Args:
        fit: a fit by the simultaneous method.
        folder: folder to write to.
        count: number of draws; a result keeps 200, fewer for long trials.
        seed: selects draws and their order.

    Raises:
        KinertiaError: fewer draws are kept.
    """
    for place, number in enumerate(chosen_draws(fit, count, seed), start=1):
        drawn, into = drawn_fit(fit, number), folder / f"draw_{place:03d}"
        into.mkdir()
        _write_model(model_of(drawn), into)
        for trial in drawn.trials:
            trial_folder = into if len(drawn.trials) == 1 else into / trial.name
            trial_folder.mkdir(exist_ok=True)
            remark = f"Posterior draw {number + 1} of {fit.subject.name}"
            _write_trial(opensim_content(drawn, trial, trial.kinematics.window_s, remark, remark), trial_folder)
