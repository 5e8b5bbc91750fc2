"""Writes a `Fit` to a folder: the report, the result to open again, tables, and files that OpenSim opens.

Everything is written to a hidden folder first and moved when complete, so a run never leaves half a result.
"""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.diagnostics.result.soundness import mass_from_force_kg
from kinertia.diagnostics.result.suitability import suitability
from kinertia.estimation.identifiability import BaseParameters
from kinertia.estimation.result.cycles import columns_of, peak_columns, phase_columns, spatiotemporal_columns
from kinertia.estimation.result.drawn_fit import chosen_draws, drawn_fit
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import forces_before, forces_used, moment_coverage
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.findings.finding import Severity
from kinertia.io.opensim.writer import export_osim
from kinertia.io.output_folder import complete_folder, expect_own_folder
from kinertia.io.subject.provenance import Provenance
from kinertia.io.text.csv_file import inert
from kinertia.io.text.sto import TimeTable, write_table
from kinertia.io.versions import VERSION
from kinertia.model.imported_model import centre_offsets
from kinertia.report.exports.opensim_files import write_ground_reactions
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit
from kinertia.report.figures.cycle_figures import CurvesByStage, drawn_curves
from kinertia.report.pages.page import render
from kinertia.report.pages.truth_comparison import Truth
from kinertia.report.wording import asymmetry_sentences
from kinertia.trial.sampled_data import rms, rms_length

FIT_FILES = ("fit.json", FIT_FILE, "report.html", "bsp.csv", "model.osim")
"""Names of results that every fit has."""
TRIAL_FILES = ("kinematics.mot", "ground_reactions.mot", "external_loads.xml", "inverse_dynamics.sto", "residuals.sto")
"""Names of results that every trial has."""
_PARTS = (slice(0, 3), slice(3, 6))
"""Force and moment of a residual."""
_ALL_DIGITS, _SIX_DIGITS = "%r", "%.6g"
_RESIDUALS = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]


def save_fit(
    fit: Fit,
    folder: str | Path,
    provenance: Provenance | None = None,
    truth: Truth | None = None,
    force: bool = False,
) -> Path:
    """Write all result files of a fit into a folder, which is made if necessary, and return the folder.

    With one trial its files are in the folder itself, with several in a sub-folder per trial. The report states
    command and files given by `provenance`, and shows the truth of a synthetic person. With `force` also among
    files that are not results of Kinertia; a file with the name of a result is refused.

    Raises:
        FileError: the folder holds such files, or cannot be written to.
    """
    if not force:
        expect_own_folder(folder, ", or force=True to write among them")
    with complete_folder(folder, "fit") as work:
        (work / "fit.json").write_text(json.dumps(summary(fit), indent=2) + "\n", encoding="utf-8")
        write_fit(fit, provenance, work / FIT_FILE, truth)
        curves = drawn_curves(fit)
        (work / "report.html").write_text(render(fit, provenance, truth=truth, curves=curves), encoding="utf-8")
        write_columns(work / "bsp.csv", fit.bsp_columns())
        _write_cycles(fit, curves, work)
        write_model(fit, work)
        for trial in fit.trials:
            into = work if len(fit.trials) == 1 else work / trial.name
            into.mkdir(exist_ok=True)
            _write_trial(fit, trial, into)
    return Path(folder)


def _write_cycles(fit: Fit, curves: CurvesByStage, folder: Path) -> None:
    """Write the tables of `Fit.contact_phases` and `Fit.peaks`; where there are strides, of these, too."""
    phases = [curve for curve in curves["estimate"] if curve.stride.phase != "stride"]
    if phases:
        write_columns(folder / "contact_phases.csv", phase_columns(phases), _SIX_DIGITS)
    names = {trial.name for trial in fit.trials if trial.joint_curves is not None}
    peaks = peak_columns([curve for curve in curves["estimate"] if curve.trial in names])
    if peaks["peak"]:
        write_columns(folder / "moment_peaks.csv", peaks, _SIX_DIGITS)
    if not any(trial.strides for trial in fit.trials):
        return
    write_columns(folder / "spatiotemporal.csv", spatiotemporal_columns(fit.trials), _SIX_DIGITS)
    write_columns(folder / "cycles.csv", columns_of(curves["estimate"]), _SIX_DIGITS)
    write_columns(folder / "cycles_literature.csv", columns_of(curves["literature"]), _SIX_DIGITS)


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


def write_model(fit: Fit, folder: Path) -> None:
    """Write the model with the estimate; for the user's own OpenSim model a list of changes, too."""
    if fit.file is None:
        export_osim(folder / "model.osim", fit.skeleton, fit.estimate)
        return
    from kinertia.io.opensim.writer import write_osim

    positions = {marker.label: marker.position for marker in fit.skeleton.markers}
    shifts = centre_offsets(fit.skeleton)
    segments = fit.file.skeleton.segments
    welds = {joint.child: joint.parent for joint in fit.skeleton.joints if joint.child not in segments}
    changes = write_osim(folder / "model.osim", fit.file, fit.estimate, positions, shifts, welds)
    changes.map(inert).to_csv(folder / "model_changes.csv", index=False, lineterminator="\n")


def _write_trial(fit: Fit, trial: TrialFit, folder: Path) -> None:
    names, rotational = fit.skeleton.coordinates, fit.skeleton.rotational
    motion, curves = f"Motion: {trial.motion_hz:.3g} Hz", trial.joint_curves
    time, stages, deviations = trial.time, trial.joint_loads, trial.deviations
    if curves is not None:
        rows = np.flatnonzero(curves.known.any(axis=1))
        time, stages = curves.time[rows], {stage: force[rows] for stage, force in curves.forces.items()}
        deviations = None if curves.deviations is None else curves.deviations.at(rows)
    if deviations is not None:
        sd = deviations.coordinates
        table = TimeTable(time, tuple(names), np.where(rotational, np.degrees(sd), sd), in_degrees=True)
        write_table(folder / "kinematics_sd.sto", table, "kinematics_sd", motion)
    forces = f"Ground reactions: {forces_used(trial.reactions, fit.settings, trial.motion_hz).which}. {motion}"
    write_table(folder / "kinematics.mot", coordinates_table(fit, trial), "kinematics", motion)
    write_ground_reactions(folder, trial.reactions, (time[0], time[-1]), fit.skeleton.feet, forces)
    loads = [f"{name}_{'moment' if turn else 'force'}" for name, turn in zip(names, rotational, strict=True)]
    before = forces_before(trial.reactions, fit.settings)
    before = f"Ground reactions: {before}, instruments not corrected. Motion: {trial.kinematics.cutoff_hz:.3g} Hz"
    files = {
        "inverse_dynamics": (stages["estimate"], forces),
        "inverse_dynamics_literature": (stages["literature"], before),
    }
    if deviations is not None:
        files["inverse_dynamics_sd"] = (deviations.moments, forces)
    for file, (values, remark) in files.items():
        write_table(folder / f"{file}.sto", TimeTable(time, tuple(loads), values, in_degrees=False), file, remark)
    if curves is not None:
        _write_joint_moments(curves, folder, forces)
    _write_residuals(trial, folder, forces)


def _write_joint_moments(curves: JointCurves, folder: Path, forces: str) -> None:
    """Write moments (N m) and reaction forces (N) of the joints in three dimensions, with standard deviations.

    What is not known is "nan"; frames in which no joint is known are left out.
    """
    joints = curves.joints["estimate"]
    rows = np.isfinite(joints.moments).any(axis=(1, 2))
    remark = f"Internal, about Grood and Suntay's axes; towards flexion, adduction, internal rotation. {forces}"
    files = {"joint_moments": (joints.names, joints.moments), "joint_forces": (joints.force_names, joints.forces)}
    if curves.moment_sd is not None and curves.force_sd is not None:
        files["joint_moments_sd"] = joints.names, curves.moment_sd
        files["joint_forces_sd"] = joints.force_names, curves.force_sd
    for file, (names, values) in files.items() if rows.any() else ():
        table = TimeTable(curves.time[rows], names, values[rows].reshape(rows.sum(), -1), in_degrees=False)
        write_table(folder / f"{file}.sto", table, file, remark)


def _write_residuals(trial: TrialFit, folder: Path, forces: str) -> None:
    """Write the root residuals of the measured frames."""
    stages = {**trial.residuals, "estimate_full": trial.full_residuals["estimate"]}
    columns = [f"{stage}_{name}" for stage in stages for name in _RESIDUALS]
    residuals = TimeTable(trial.time, tuple(columns), np.hstack(list(stages.values())), in_degrees=False)
    remark = f"Ground reactions: of the motion's bandwidth; estimate_full: {forces.partition(': ')[2]}"
    write_table(folder / "residuals.sto", residuals, "residuals", remark)


def coordinates_table(fit: Fit, trial: TrialFit) -> TimeTable:
    """Arrange coordinates over time, in degrees and m; all coordinates of the file for an OpenSim model."""
    time, q = (
        (trial.time, trial.motion.q)
        if trial.trajectory is None
        else (trial.kinematics.trajectory_time, trial.trajectory)
    )
    if fit.file is None:
        names, angles = fit.skeleton.coordinates, fit.skeleton.rotational
    else:
        names = tuple(coordinate.name for coordinate in fit.file.coordinates)
        angles = np.array([coordinate.angle for coordinate in fit.file.coordinates])
        q = fit.file.all_coordinates(fit.skeleton, q)
    return TimeTable(time, tuple(names), np.where(angles, np.degrees(q), q), in_degrees=True)


def summary(fit: Fit) -> dict[str, Any]:
    """Return the content of `fit.json`."""
    return {
        "kinertia": VERSION,
        "method": fit.settings.method,
        "subject": fit.subject.model_dump(),
        "settings": fit.settings.model_dump(),
        "total_mass_kg": {
            "measured": fit.subject.mass_kg,
            "literature": fit.literature.total_mass_kg,
            "estimate": fit.estimate.total_mass_kg,
        },
        "converged": fit.converged,
        **_posterior_summary(fit),
        "asymmetry": asymmetry_sentences(fit),
        "trials": [_trial_summary(fit, trial) for trial in fit.trials],
        "verdict": fit.overview.verdict,
        "rules_run": fit.rules,
        "trials_left_out": list(fit.left_out),
        "findings": [finding.to_dict() for finding in fit.findings],
        "suitability": [asdict(rating) for rating in suitability(fit, fit.findings, fit.left_out)],
        "warnings": list(fit.overview.lines(Severity.WARNING, Severity.ERROR)),
        "corrections": list(fit.overview.lines(Severity.CORRECTED)),
        "notes": list(fit.notes),
    }


def _posterior_summary(fit: Fit) -> dict[str, Any]:
    if fit.posterior is None:
        return {}
    noise = {trial.name: dict(vars(noise)) for trial, noise in zip(fit.trials, fit.posterior.marker_noise, strict=True)}
    return {
        "iterations": fit.posterior.iterations,
        "calibration": [asdict(entry) for entry in fit.posterior.calibration],
        "marker_noise": noise,
        "identifiability": _identifiability(fit.bsp_columns(), fit.posterior.base),
    }


def _identifiability(bsp: Mapping[str, Sequence[Any]], base: BaseParameters) -> dict[str, Any]:
    """Return parameters by evidence, and the combinations that the motion does or does not determine."""
    by_evidence: dict[str, list[str]] = {"measured": [], "informed": [], "assumed": []}
    for segment, parameter, word in zip(bsp["segment"], bsp["parameter"], bsp["evidence"], strict=True):
        if word in by_evidence:
            by_evidence[word].append(f"{segment}.{parameter}")
    return {
        **by_evidence,
        "base_parameters": {
            "count": base.count,
            "shown": base.shown,
            "condition": base.condition if math.isfinite(base.condition) else None,
            "best_shown": [dict(vars(combination)) for combination in base.best],
            "never_shown": list(base.never),
        },
    }


def _trial_summary(fit: Fit, trial: TrialFit) -> dict[str, Any]:
    force, moment = ({stage: load[:, part] for stage, load in trial.residuals.items()} for part in _PARTS)
    full_force, full_moment = (
        {stage: load[:, part] for stage, load in trial.full_residuals.items()} for part in _PARTS
    )
    return {
        "name": trial.name,
        "n_frames": len(trial.kinematics.trial.markers.time),
        "n_dynamic_frames": len(trial.time),
        "window_s": list(trial.kinematics.window_s),
        "windows_s": [list(window) for window in trial.kinematics.windows_s],
        "task": trial.kinematics.trial.task,
        "condition": trial.kinematics.trial.condition,
        "joint_moments": {leg.word: leg.to_dict() for leg in moment_coverage(trial)},
        "turned_deg": trial.kinematics.turned_deg,
        "cutoff_hz": trial.kinematics.cutoff_hz,
        "motion_hz": trial.motion_hz,
        "force_cutoff_hz": trial.reactions.cutoff_hz,
        "impact_force_rms_N": trial.reactions.impact_n,
        "mass_from_force_kg": mass_from_force_kg(fit.literature, trial) if trial.kinematics.complete else None,
        "seconds": {stage: round(value, 4) for stage, value in trial.seconds.items()},
        "marker_rms_m": {stage: rms(values) for stage, values in trial.marker_errors_m.items()},
        "marker_displacements_m": _displacements(fit, trial),
        "residual_force_rms_N": _each(force, rms_length),
        "residual_force_max_N": _each(force, _max),
        "residual_moment_rms_Nm": _each(moment, rms_length),
        "residual_moment_max_Nm": _each(moment, _max),
        "full_residual_force_rms_N": _each(full_force, rms_length),
        "full_residual_force_max_N": _each(full_force, _max),
        "full_residual_moment_rms_Nm": _each(full_moment, rms_length),
        "full_residual_moment_max_Nm": _each(full_moment, _max),
    }


def _displacements(fit: Fit, trial: TrialFit) -> dict[str, list[float]]:
    """Return the displacements of markers in this trial from their positions in the model, in segment axes."""
    moved = trial.skeleton.marker_locals - fit.skeleton.marker_locals
    return {label: row.tolist() for label, row in zip(fit.skeleton.labels, moved, strict=True) if row.any()}


def _each(vectors: Mapping[str, np.ndarray], statistic: Any) -> dict[str, float | None]:
    """Return a statistic of every stage; None where it is not known."""
    return {stage: statistic(values) if np.isfinite(values).all() else None for stage, values in vectors.items()}


def _max(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


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
        write_model(drawn, into)
        for trial in drawn.trials:
            trial_folder = into if len(drawn.trials) == 1 else into / trial.name
            trial_folder.mkdir(exist_ok=True)
            remark = f"Posterior draw {number + 1} of {fit.subject.name}"
            write_table(trial_folder / "kinematics.mot", coordinates_table(drawn, trial), "kinematics", remark)
            write_ground_reactions(
                trial_folder, trial.reactions, trial.kinematics.window_s, drawn.skeleton.feet, remark
            )
