"""Writes results of a trial into its C3D file, as Vicon and Visual3D name and type model outputs."""

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinertia.errors import FileError
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.leg_moments import output_times, outputs_of
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.io.c3d.file_contents import EventToWrite
from kinertia.io.c3d.outputs import C3dFrames, Measure, OutputPoint, frames_of, too_many, unit_factor, with_outputs
from kinertia.io.c3d.parameters import TooManyParameters, Value
from kinertia.io.c3d.writer import write_c3d
from kinertia.io.recording import read_recording
from kinertia.io.subject.provenance import trial_file
from kinertia.io.versions import VERSION
from kinertia.model.bsp import PARAMETERS
from kinertia.model.marker_set import shared_prefix, spellings
from kinertia.motion.gait_cycle import Stride, feet_under_pelvis, found_events
from kinertia.motion.joint_moments import leg_joints
from kinertia.motion.model_outputs import CONVENTIONS, UNITS, Convention, ModelOutput
from kinertia.motion.spatiotemporal import Spatiotemporal, spatiotemporal
from kinertia.report.exports.saved_fit import SavedFit
from kinertia.trial.data import FEET, Recording

SUFFIX = "Kinertia"
"""Ends all labels where the file has outputs of the same names already."""
SD = "SD"
NO_DEVIATION = -1.0
"""Value on axes without an SD, where a point has others: readers take a point with any NaN for missing."""
_PLUG_IN_GAIT = ({"LASI", "RASI", "LTHI", "RTHI", "LTIB", "RTIB"}, {"LASI", "RASI", "LTHI", "RTHI", "SACR"})
_SAME_PLACE = 1e-3
"""Largest error of markers against the fit's, as a share of their distances: a file stores single precision."""
_SAME_TIME_FRAMES = 0.02
_CONTEXTS = {"r": "Right", "l": "Left"}


def write_c3d_results(
    saved: SavedFit, results: Path, recordings: Path | None, convention: str | None, folder: Path
) -> Convention:
    """Write a C3D file with its results for each trial of a fit; return the convention.

    Args:
        saved: the fit.
        results: folder of the fit.
        recordings: folder of the trials' files; searched for if None (`trial_file`).
        convention: convention of signs, axes and units; the usual one of the marker set if None.
        folder: folder to write to.

    Raises:
        FileError: a trial's file is not found, has changed, or cannot take results.
    """
    fit, provenance = saved.fit, saved.provenance
    chosen = next(
        (known_convention for known_convention in CONVENTIONS if known_convention == convention), usual_convention(fit)
    )
    for trial in fit.trials:
        path = trial_file(provenance, trial.name, results, recordings)
        source = path if path.suffix.lower() == ".c3d" else read_recording(path)
        content = c3d_with_results(fit, trial, source, chosen, provenance.files if provenance is not None else {})
        (folder / f"{trial.name}.c3d").write_bytes(content)
    return chosen


def usual_convention(fit: Fit) -> Convention:
    """Return Plug-in Gait's convention where its markers are present, else ISB's."""
    prefix = shared_prefix(fit.skeleton.labels)
    labels = {label.removeprefix(prefix) for label in fit.skeleton.labels}
    return "plug-in-gait" if any(needed <= labels for needed in _PLUG_IN_GAIT) else "isb"


def new_file(recording: Recording, folder: Path) -> Path:
    """Write a C3D file for a recording in other formats; plates whose corners are unknown are left out."""
    plates = recording.plates if recording.plates is not None and recording.plates.corners is not None else None
    path = folder / f"{recording.name}.c3d"
    write_c3d(path, replace(recording, plates=plates))
    return path


def c3d_with_results(
    fit: Fit, trial: TrialFit, source: Path | Recording, convention: Convention, files: Mapping[str, str]
) -> bytes:
    """Return the content of a C3D file with a trial's results.

    Args:
        fit, trial: the fit and its trial.
        source: the trial's own C3D file, or its recording read from other formats.
        convention: convention of signs, axes and units.
        files: SHA-256 of the files of the fit, by name.

    Raises:
        FileError: the file is damaged, is not the trial's, or has no room.
    """
    if isinstance(source, Recording):
        with tempfile.TemporaryDirectory() as folder:
            return c3d_with_results(fit, trial, new_file(source, Path(folder)), convention, files)
    frames = frames_of(source)
    prefix = prefix_of(frames, trial)
    at = _frames_at(source, frames, trial)
    outputs = outputs_of(fit, trial, convention)
    if not outputs:
        legs = "legs are not hip, knee and ankle with axes forward, up and right"
        raise FileError(source, f"cannot take results of the model {fit.skeleton.name}: its {legs}")
    points = [*_points(outputs, frames, at, UNITS[convention]), *_centres(source, frames, trial, prefix, at)]
    taken = set(frames.labels)
    if any(prefix + point.label in taken for point in points):
        points = [replace(point, label=_suffixed(point.label)) for point in points]
    units = {kind: frames.units.get(kind, unit) for kind, unit in UNITS[convention].items()}
    known = found_events(trial.skeleton, trial.kinematics)
    events = [EventToWrite(event.event, event.source) for event in known if event.source != "file"]
    try:
        parameters, measures = _own(fit, convention, files, units), _stride_measures(trial)
        return with_outputs(frames, points, prefix, units, parameters, events, measures)
    except TooManyParameters:
        raise too_many(source) from None


def _suffixed(label: str) -> str:
    return label[: -len(SD)] + SUFFIX + SD if label.endswith(SD) else label + SUFFIX


def prefix_of(frames: C3dFrames, trial: TrialFit) -> str:
    """Return the subject prefix that most of the trial's markers have in the file.

    Labels of other people in it keep their prefixes, and do not count.
    """
    labels = set(frames.labels)
    every = trial.kinematics.trial.markers.labels
    unprefixed = [label for label in every if ":" not in label] or every
    prefixes = dict.fromkeys(["", *(label.split(":", 1)[0] + ":" for label in frames.labels if ":" in label)])
    return max(prefixes, key=lambda prefix: sum(prefix + label in labels for label in unprefixed))


def _frames_at(source: Path, frames: C3dFrames, trial: TrialFit) -> np.ndarray:
    """Return the indices (w,) in the file of the frames of the fit."""
    exact = output_times(trial) * frames.rate_hz - (frames.first - 1)
    at = exact.round().astype(int)
    if np.abs(exact - at).max() > _SAME_TIME_FRAMES or at[0] < 0 or at[-1] >= len(frames.points):
        raise _another(source, trial)
    return at


def _another(source: Path, trial: TrialFit) -> FileError:
    return FileError(source, f"holds other frames or markers than trial {trial.name} of the fit; give its own file")


def _points(
    outputs: list[ModelOutput], frames: C3dFrames, at: np.ndarray, units: Mapping[str, str]
) -> list[OutputPoint]:
    """Return outputs and their SDs at all frames of the file, in the file's units where it states others."""
    points, count = [], len(frames.points)
    for output in outputs:
        written_factor = unit_factor(output.kind, units[output.kind])
        stated = unit_factor(output.kind, frames.units.get(output.kind, units[output.kind]))
        assert written_factor is not None
        assert stated is not None  # `frames_of` refuses others
        factor = written_factor / stated
        points.append(OutputPoint(output.name, output.kind, _spread(factor * output.values, at, count)))
        if np.isfinite(output.sd).any():
            sd = np.where(np.isfinite(output.sd), factor * output.sd, NO_DEVIATION)
            points.append(OutputPoint(output.name + SD, output.kind, _spread(sd, at, count), "SD; -1: none"))
    return points


def _spread(values: np.ndarray, at: np.ndarray, count: int) -> np.ndarray:
    result = np.full((count, 3), np.nan)
    result[at] = values
    return result


def _centres(source: Path, frames: C3dFrames, trial: TrialFit, prefix: str, at: np.ndarray) -> list[OutputPoint]:
    """Return joint centres in the axes and units of the file."""
    lab, origin = to_file(source, frames, trial, prefix)
    pose = trial.skeleton.pose(trial.motion.q if trial.joint_curves is None else trial.joint_curves.motion.q)
    return [
        OutputPoint(
            f"{joint.side.upper()}{joint.name[0]}JC",
            "",
            _spread(joint.centre(trial.skeleton, pose) @ lab + origin, at, len(frames.points)),
            f"{joint.name.lower()} joint centre",
        )
        for joint in leg_joints(trial.skeleton)
    ]


def to_file(source: Path, frames: C3dFrames, trial: TrialFit, prefix: str) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation (3, 3) and translation (3,) from the axes of the fit (m, facing +X) to the file's, by markers."""
    markers, columns = trial.kinematics.trial.markers, {label: k for k, label in enumerate(frames.labels)}
    wanted = [prefix + label for label in markers.labels]
    read_as = spellings(wanted, frames.labels)
    written = [read_as.get(label, label) for label in wanted]
    shared = [(k, columns[label]) for k, label in enumerate(written) if label in columns]
    index = (markers.time * frames.rate_hz - (frames.first - 1)).round().astype(int)
    inside = (index >= 0) & (index < len(frames.points))
    ours = markers.positions[inside][:, [k for k, _ in shared]].reshape(-1, 3)
    theirs = frames.points[index[inside]][:, [k for _, k in shared]].reshape(-1, 3)
    known = np.isfinite(ours).all(axis=1) & np.isfinite(theirs).all(axis=1)
    if known.sum() < 100:
        raise _another(source, trial)
    ours, theirs = np.column_stack([ours[known], np.ones(known.sum())]), theirs[known]
    for _ in range(3):  # markers whose labels were corrected have other labels in the file
        turn, *_ = np.linalg.lstsq(ours, theirs, rcond=None)
        apart = np.linalg.norm(ours @ turn - theirs, axis=1)
        near = apart <= max(3.0 * float(np.median(apart)), 1e-9)
        ours, theirs = ours[near], theirs[near]
    if np.median(apart) > _SAME_PLACE * float(np.ptp(theirs, axis=0).max()):
        raise _another(source, trial)
    return turn[:3], turn[3]


def _own(
    fit: Fit, convention: Convention, files: Mapping[str, str], units: Mapping[str, str]
) -> dict[str, tuple[Value, tuple[int, ...] | None]]:
    """Return the group KINERTIA: what the outputs are, segment masses (kg), centres of mass (m, segment axes)."""
    bsp, table = fit.estimate, fit.estimate.table()
    coms = [PARAMETERS.index(name) for name in ("com_x", "com_y", "com_z")]
    count = len(bsp.segments)
    parameters: dict[str, tuple[Value, tuple[int, ...] | None]] = {
        "VERSION": ([VERSION], None),
        "CONVENTION": ([convention], None),
        "UNITS": ([f"{kind} {unit}{'' if kind == 'ANGLES' else '/kg'}" for kind, unit in units.items()], None),
        "BODY_MASS": (np.array([fit.mass_kg]), None),
        "SEGMENTS": (list(bsp.segments), None),
        "MASS": (table[:, PARAMETERS.index("mass")], None),
        "COM": (table[:, coms], (3, count)),
    }
    if fit.posterior is not None:
        parameters["MASS_SD"] = (fit.posterior.sd[:, PARAMETERS.index("mass")], None)
        parameters["COM_SD"] = (fit.posterior.sd[:, coms], (3, count))
    if files:
        parameters["FILES"], parameters["SHA256"] = (list(files), None), (list(files.values()), None)
    return parameters


def _stride_measures(trial: TrialFit) -> list[Measure]:
    """Return all mean stride measures that are known, with Vicon's names and units; none without strides."""
    if not trial.strides:
        return []
    feet = feet_under_pelvis(trial.skeleton, trial.kinematics)
    found = [
        (stride.side, _measures(stride, measured))
        for stride, measured in zip(
            trial.strides, spatiotemporal(feet, trial.strides, trial.kinematics.trial.belt), strict=True
        )
    ]
    result = []
    for side in FEET:
        of_side = [measures for measured_side, measures in found if measured_side == side]
        for name, unit in of_side[0] if of_side else ():
            values = np.array([measures[name, unit] for measures in of_side])
            if np.isfinite(values).any():
                result.append(Measure(_CONTEXTS[side], name, unit, float(np.nanmean(values))))
    return result


def _measures(stride: Stride, measured: Spatiotemporal) -> dict[tuple[str, str], float]:
    """Return the measures by name and unit."""
    return {
        ("Cadence", "steps/min"): measured.cadence_steps_min,
        ("Walking Speed", "m/s"): measured.speed_m_s,
        ("Stride Time", "s"): measured.stride_time_s,
        ("Step Time", "s"): measured.step_time_s,
        ("Opposite Foot Off", "%"): stride.percent(stride.opposite_toe_off_s),
        ("Opposite Foot Contact", "%"): stride.percent(stride.opposite_strike_s),
        ("Foot Off", "%"): stride.percent(stride.toe_off_s),
        ("Single Support", "s"): stride.opposite_strike_s - stride.opposite_toe_off_s,
        ("Double Support", "s"): 0.01 * measured.double_support_percent * measured.stride_time_s,
        ("Stride Length", "m"): measured.stride_length_m,
        ("Step Length", "m"): measured.step_length_m,
        ("Step Width", "m"): measured.step_width_m,
    }
