"""Computes all that the result files of a fit hold, before any of it is written: `FitContent`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kinertia.diagnostics.result.soundness import mass_from_force_kg
from kinertia.diagnostics.result.suitability import suitability
from kinertia.estimation.identifiability import BaseParameters
from kinertia.estimation.result.cycles import columns_of, peak_columns, phase_columns, spatiotemporal_columns
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import forces_before, forces_used
from kinertia.estimation.result.trial_fit import JointCurves, TrialFit
from kinertia.io.opensim.writer import edited_osim, osim_text
from kinertia.io.subject.provenance import Provenance
from kinertia.io.text.sto import TimeTable
from kinertia.io.versions import VERSION
from kinertia.model.imported_model import centre_offsets
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.report.pages.page import render
from kinertia.report.pages.truth_comparison import Truth
from kinertia.report.wording import asymmetry_sentences
from kinertia.trial.data import FEET
from kinertia.trial.sampled_data import rms, rms_length

if TYPE_CHECKING:
    import pandas as pd


_MARGIN = 12
"""Samples of the ground reactions outside the motion's time."""
_MOTION_FILE, _FORCES_FILE = "kinematics.mot", "ground_reactions.mot"
_PARTS = (slice(0, 3), slice(3, 6))
"""Force and moment of a residual."""
_RESIDUALS = [f"{kind}_{axis}" for kind in ("force", "moment") for axis in "xyz"]


class Series(NamedTuple):
    """Columns over time, with the remark in the header of their file."""

    table: TimeTable
    remark: str


class Model(NamedTuple):
    """Content of `model.osim`, and what changed in the user's own OpenSim model; None for the built-in one."""

    osim: bytes
    changes: pd.DataFrame | None


@dataclass(frozen=True, eq=False)
class TrialContent:
    """Content of the files of one trial.

    Attributes:
        name: of the trial.
        series: columns over time, by name of the file.
        external_loads: text of `external_loads.xml`.
    """

    name: str
    series: Mapping[str, Series]
    external_loads: str


@dataclass(frozen=True, eq=False)
class FitContent:
    """Content of all result files of a fit.

    Attributes:
        fit: the result, for `fit.npz`.
        provenance: command and files of the result, if known.
        truth: of a synthetic person.
        summary: of `fit.json`.
        report: HTML of `report.html`.
        tables: columns of the CSV files, by name of the file.
        model: of the model with the estimate.
        trials: of the files of each trial.
    """

    fit: Fit
    provenance: Provenance | None
    truth: Truth | None
    summary: Mapping[str, Any]
    report: str
    tables: Mapping[str, Mapping[str, Any]]
    model: Model
    trials: tuple[TrialContent, ...]


def content_of(fit: Fit, provenance: Provenance | None = None, truth: Truth | None = None) -> FitContent:
    """Compute the content of all result files.

    Args:
        fit: the fit.
        provenance: command and files, stated by the report; a fit made in Python has none.
        truth: truth of a synthetic person, shown by the report.
    """
    return FitContent(
        fit,
        provenance,
        truth,
        summary(fit),
        render(fit, provenance, truth=truth),
        _tables(fit),
        model_of(fit),
        tuple(_of_trial(fit, trial) for trial in fit.trials),
    )


def _tables(fit: Fit) -> dict[str, Mapping[str, Any]]:
    """Tabulate parameters, `Fit.contact_phases` and `Fit.peaks`; where there are strides, these, too."""
    tables: dict[str, Mapping[str, Any]] = {"bsp.csv": fit.bsp_columns()}
    phases = [curve for curve in fit.curves["estimate"] if curve.stride.phase != "stride"]
    if phases:
        tables["contact_phases.csv"] = phase_columns(phases)
    names = {trial.name for trial in fit.trials if trial.joint_curves is not None}
    peaks = peak_columns([curve for curve in fit.curves["estimate"] if curve.trial in names])
    if peaks["peak"]:
        tables["moment_peaks.csv"] = peaks
    if any(trial.strides for trial in fit.trials):
        tables["spatiotemporal.csv"] = spatiotemporal_columns(fit.trials)
        tables["cycles.csv"] = columns_of(fit.curves["estimate"])
        tables["cycles_literature.csv"] = columns_of(fit.curves["literature"])
    return tables


def _of_trial(fit: Fit, trial: TrialFit) -> TrialContent:
    names, rotational = fit.skeleton.coordinates, fit.skeleton.rotational
    motion, curves = f"Motion: {trial.motion_hz:.3g} Hz", trial.joint_curves
    time, stages, deviations = trial.time, trial.joint_loads, trial.deviations
    if curves is not None:
        rows = np.flatnonzero(curves.known.any(axis=1))
        time, stages = curves.time[rows], {stage: force[rows] for stage, force in curves.forces.items()}
        deviations = None if curves.deviations is None else curves.deviations.at(rows)
    forces = f"Ground reactions: {forces_used(trial.reactions, fit.settings, trial.motion_hz).which}. {motion}"
    before = forces_before(trial.reactions, fit.settings)
    before = f"Ground reactions: {before}, instruments not corrected. Motion: {trial.kinematics.cutoff_hz:.3g} Hz"
    series = {}
    if deviations is not None:
        sd = deviations.coordinates
        table = TimeTable(time, tuple(names), np.where(rotational, np.degrees(sd), sd), in_degrees=True)
        series["kinematics_sd.sto"] = Series(table, motion)
    loads = [f"{name}_{'moment' if turn else 'force'}" for name, turn in zip(names, rotational, strict=True)]
    dynamics = {
        "inverse_dynamics.sto": (stages["estimate"], forces),
        "inverse_dynamics_literature.sto": (stages["literature"], before),
    }
    if deviations is not None:
        dynamics["inverse_dynamics_sd.sto"] = (deviations.moments, forces)
    for file, (values, remark) in dynamics.items():
        series[file] = Series(TimeTable(time, tuple(loads), values, in_degrees=False), remark)
    if curves is not None:
        series |= _joint_moments(curves, forces)
    series["residuals.sto"] = _residuals(trial, forces)
    opensim = opensim_content(fit, trial, (time[0], time[-1]), motion, forces)
    return replace(opensim, series={**opensim.series, **series})


def _joint_moments(curves: JointCurves, forces: str) -> dict[str, Series]:
    """Tabulate moments (N m) and reaction forces (N) of the joints in three dimensions, with standard deviations.

    What is not known is "nan"; frames in which no joint is known are left out.
    """
    joints = curves.joints["estimate"]
    rows = np.isfinite(joints.moments).any(axis=(1, 2))
    remark = f"Internal, about Grood and Suntay's axes; towards flexion, adduction, internal rotation. {forces}"
    files = {"joint_moments": (joints.names, joints.moments), "joint_forces": (joints.force_names, joints.forces)}
    if curves.moment_sd is not None and curves.force_sd is not None:
        files["joint_moments_sd"] = joints.names, curves.moment_sd
        files["joint_forces_sd"] = joints.force_names, curves.force_sd
    result = {}
    for file, (names, values) in files.items() if rows.any() else ():
        table = TimeTable(curves.time[rows], names, values[rows].reshape(rows.sum(), -1), in_degrees=False)
        result[f"{file}.sto"] = Series(table, remark)
    return result


def _residuals(trial: TrialFit, forces: str) -> Series:
    """Tabulate the root residuals of the measured frames."""
    stages = {**trial.residuals, "estimate_full": trial.full_residuals["estimate"]}
    columns = [f"{stage}_{name}" for stage in stages for name in _RESIDUALS]
    residuals = TimeTable(trial.time, tuple(columns), np.hstack(list(stages.values())), in_degrees=False)
    return Series(residuals, f"Ground reactions: of the motion's bandwidth; estimate_full: {forces.partition(': ')[2]}")


def opensim_content(fit: Fit, trial: TrialFit, window_s: tuple[float, float], motion: str, forces: str) -> TrialContent:
    """Compute the content of the files that OpenSim needs of a trial: motion and ground reactions.

    Args:
        fit: the fit, or a draw of it.
        trial: of the fit.
        window_s: first and last time of the motion.
        motion, forces: remarks in the headers of these files.
    """
    series = {
        _MOTION_FILE: Series(_coordinates(fit, trial), motion),
        _FORCES_FILE: Series(_ground_reactions(trial.reactions, window_s), forces),
    }
    return TrialContent(trial.name, series, _external_loads(fit.skeleton.feet))


def _ground_reactions(reactions: GroundReactions, window_s: tuple[float, float]) -> TimeTable:
    """Arrange ground reactions over time: per foot force (N), point where it acts (m), torque there (N m).

    In ground axes. Without load the point is constant at its nearest loaded position: OpenSim fits splines to the
    columns, which would oscillate at a jump.

    Args:
        reactions: reactions on the motion's time base.
        window_s: first and last time of the motion; some samples outside are included, since splines are inaccurate at
            their ends.
    """
    first, last = np.searchsorted(reactions.time, window_s)
    rows = slice(max(int(first) - _MARGIN, 0), int(last) + _MARGIN)
    columns: dict[str, np.ndarray] = {}
    for foot, side in enumerate(FEET):
        force = reactions.wrench[:, foot, :3]
        point = reactions.point[:, foot]
        for stem, values in (("force_{}_v", force), ("force_{}_p", point), ("torque_{}_", reactions.torque[:, foot])):
            columns |= {f"ground_{stem.format(side)}{axis}": values[rows, k] for k, axis in enumerate("xyz")}
    return TimeTable(reactions.time[rows], tuple(columns), np.column_stack(list(columns.values())), False)


def _external_loads(feet: Sequence[str]) -> str:
    """Return the text of `external_loads.xml`, which applies the columns of the ground reactions to the feet."""
    forces = [
        f'''      <ExternalForce name="{name}_foot">
        <applied_to_body>{escape(body, quote=False)}</applied_to_body>
        <force_expressed_in_body>ground</force_expressed_in_body>
        <point_expressed_in_body>ground</point_expressed_in_body>
        <force_identifier>ground_force_{side}_v</force_identifier>
        <point_identifier>ground_force_{side}_p</point_identifier>
        <torque_identifier>ground_torque_{side}_</torque_identifier>
      </ExternalForce>'''
        for name, side, body in zip(("right", "left"), FEET, feet, strict=True)
    ]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8" ?>',
            '<OpenSimDocument Version="40000">',
            '  <ExternalLoads name="ground_reactions">',
            "    <objects>",
            *forces,
            "    </objects>",
            "    <groups />",
            f"    <datafile>{_FORCES_FILE}</datafile>",
            "  </ExternalLoads>",
            "</OpenSimDocument>",
            "",
        ]
    )


def model_of(fit: Fit) -> Model:
    """Return the model with the estimate; for the user's own OpenSim model what changed, too."""
    if fit.file is None:
        return Model(osim_text(fit.skeleton, fit.estimate).encode(), None)
    positions = {marker.label: marker.position for marker in fit.skeleton.markers}
    shifts = centre_offsets(fit.skeleton)
    segments = fit.file.skeleton.segments
    welds = {joint.child: joint.parent for joint in fit.skeleton.joints if joint.child not in segments}
    return Model(*edited_osim(fit.file, fit.estimate, positions, shifts, welds))


def _coordinates(fit: Fit, trial: TrialFit) -> TimeTable:
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
    posterior = _posterior_summary(fit)
    trials = [_trial_summary(fit, trial) for trial in fit.trials]
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
        **posterior,
        "asymmetry": asymmetry_sentences(fit),
        "trials": trials,
        "verdict": fit.overview.verdict,
        "rules_run": fit.rules,
        "trials_left_out": list(fit.left_out),
        "findings": [finding.to_dict() for finding in fit.findings],
        "suitability": [asdict(rating) for rating in suitability(fit, fit.findings, fit.left_out)],
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
    moved = trial.skeleton.marker_locals - fit.skeleton.marker_locals
    displacements = {name: row.tolist() for name, row in zip(fit.skeleton.labels, moved, strict=True) if row.any()}
    return {
        "name": trial.name,
        "n_frames": len(trial.kinematics.trial.markers.time),
        "n_dynamic_frames": len(trial.time),
        "window_s": list(trial.kinematics.window_s),
        "windows_s": [list(window) for window in trial.kinematics.windows_s],
        "task": trial.kinematics.trial.task,
        "condition": trial.kinematics.trial.condition,
        "joint_moments": {leg.word: leg.to_dict() for leg in trial.coverage},
        "turned_deg": trial.kinematics.turned_deg,
        "cutoff_hz": trial.kinematics.cutoff_hz,
        "motion_hz": trial.motion_hz,
        "force_cutoff_hz": trial.reactions.cutoff_hz,
        "impact_force_rms_N": trial.reactions.impact_n,
        "mass_from_force_kg": mass_from_force_kg(fit.literature, trial) if trial.kinematics.complete else None,
        "seconds": {stage: round(value, 4) for stage, value in trial.seconds.items()},
        "marker_rms_m": {stage: rms(values) for stage, values in trial.marker_errors_m.items()},
        "marker_displacements_m": displacements,
        "residual_force_rms_N": _each(force, rms_length),
        "residual_force_max_N": _each(force, _max),
        "residual_moment_rms_Nm": _each(moment, rms_length),
        "residual_moment_max_Nm": _each(moment, _max),
        "full_residual_force_rms_N": _each(full_force, rms_length),
        "full_residual_force_max_N": _each(full_force, _max),
        "full_residual_moment_rms_Nm": _each(full_moment, rms_length),
        "full_residual_moment_max_Nm": _each(full_moment, _max),
    }


def _each(vectors: Mapping[str, np.ndarray], statistic: Any) -> dict[str, float | None]:
    """Return a statistic of every stage; None where it is not known."""
    return {stage: statistic(values) if np.isfinite(values).all() else None for stage, values in vectors.items()}


def _max(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())
