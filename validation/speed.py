"""Time every stage of a fit next to OpenSim.

Times every stage of `kinertia fit` next to OpenSim, at one, two and four times the length.

OpenSim's InverseKinematicsTool solves the same markers in the same run, with the set-up file and scaled model that come
with the data; its GCVSplineSet smooths the same coordinates. Both sides are the best of a few runs.
"""

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import opensim
import pandas as pd
import pinocchio
import typer
from threadpoolctl import threadpool_limits

from kinertia.estimation.identifiability import ParameterVector
from kinertia.estimation.prepared import known
from kinertia.estimation.two_level import TwoLevelProblem, Window, intervals
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.text.sto import read_sto, write_sto
from kinertia.io.text.trc import read_trc, write_trc
from kinertia.model.anthropometry import literature_bsp
from kinertia.model.gait27 import Gait27, build_gait27
from kinertia.model.marker_set import MarkerSet
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.motion.smoothing import smooth
from kinertia.settings import Subject
from kinertia.trial.data import Markers, Recording
from kinertia.trial.plate_assignment import build_trial
from kinertia.workflow.built_in_model import calibrate
from validation.command_speed import command_section
from validation.core_speed import core_section
from validation.estimate_speed import speed_section, timed
from validation.first_run import first_run_section
from validation.measured_data import data_folder
from validation.measured_trials import table
from validation.page import write_page
from validation.walks import WALKS, fit_arguments

SETUPS = {
    "gait2354": ("gait2354/subject01_Setup_IK.xml", "gait2354/subject01_scaled.osim"),
    "rajagopal": ("rajagopal_walk/ik_setup_walk.xml", "rajagopal_walk/scaled.osim"),
}
WINDOW_S = {"gait2354": (0.0, 2.5), "rajagopal": (0.5, 1.9)}
"""Stretches in which all ground contact is measured: they can be repeated back and forth."""
ESTIMATED_S = (10.0, 20.0)
"""Lengths of the synthetic walks that are estimated."""
STAGES = ("read", "calibration", "inverse kinematics", "smoothing", "two-level evaluation", "inverse dynamics")


@dataclass(frozen=True)
class Walk:
    """One walk as files, and the person's data for the command line."""

    markers: Path
    forces: Path
    loads: Path
    static: Path
    mass_kg: float
    subject: Subject


def _model(static: Recording, marker_set: MarkerSet, subject: Subject) -> Gait27:
    return build_gait27(static, marker_set, known(subject.height_m), known(subject.sex))


def walk(name: str) -> Walk:
    """Return the measured walk."""
    markers, *options = fit_arguments(data_folder(), name)
    given = dict(zip(options[::2], options[1::2], strict=True))
    subject = Subject(name=name, sex="male", mass_kg=float(given["--mass"]), height_m=float(given["--height"]))
    forces, loads, static = (Path(given[f"--{kind}"]) for kind in ("forces", "loads", "static"))
    return Walk(Path(markers), forces, loads, static, float(given["--mass"]), subject)


def there_and_back(values: np.ndarray, times: int) -> np.ndarray:
    """Repeat values `times` times along the first axis, every second copy backwards, so that nothing jumps."""
    parts = [values if k % 2 == 0 else values[::-1] for k in range(times)]
    return np.concatenate([part if k == 0 else part[1:] for k, part in enumerate(parts)])


def lengthened(walked: Walk, window_s: tuple[float, float], times: int, folder: Path) -> Walk:
    """Write the walk's window repeated back and forth, as files."""
    folder.mkdir(exist_ok=True)
    markers = read_trc(walked.markers).cut(*window_s)
    positions = there_and_back(markers.positions, times)
    clock = markers.time[0] + np.arange(len(positions)) / markers.rate_hz
    write_trc(folder / "walk.trc", Markers(clock, markers.labels, positions))
    table = read_sto(walked.forces)
    table = table[(table.index >= window_s[0]) & (table.index <= window_s[1])]
    forces = there_and_back(table.to_numpy(), times)
    step = (table.index[-1] - table.index[0]) / (len(table) - 1)
    index = pd.Index(table.index[0] + np.arange(len(forces)) * step, name="time")
    write_sto(folder / "walk.mot", pd.DataFrame(forces, index, table.columns), False, "walk")
    return Walk(folder / "walk.trc", folder / "walk.mot", walked.loads, walked.static, walked.mass_kg, walked.subject)


def best(runs: int, work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the shortest time (s) of a few runs, and the result of the work."""
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - started)
    return min(times), result


def ours(walked: Walk, runs: int) -> tuple[dict[str, float], int]:
    """Return Kinertia's seconds per stage, and the number of frames."""
    seconds = {}
    seconds["read"], recording = best(runs, lambda: read_recording(walked.markers, walked.forces, walked.loads))
    static = read_recording(walked.static)
    marker_set = choose_marker_set(static.markers.labels)
    feet = foot_labels(marker_set, recording.markers)
    span = (float(recording.markers.time[0]), float(recording.markers.time[-1]))
    trial = build_trial(recording, feet, span)
    model = _model(static, marker_set, walked.subject)
    seconds["calibration"], calibrated = best(min(runs, 2), lambda: calibrate(model, [trial]))
    skeleton = calibrated.skeleton
    seconds["inverse kinematics"], ik = best(runs, lambda: solve_ik(skeleton, trial.markers))
    seconds["smoothing"], spline = best(runs, lambda: smooth(ik.time, ik.q, "gcv"))
    motion = Motion(*(spline(ik.time, order) for order in range(3)))
    columns = trial.loads.wrench.reshape(-1, 12)
    loads = smooth(trial.loads.time, columns, 10.0)(ik.time).reshape(-1, 2, 6)
    bsp = literature_bsp(
        walked.mass_kg, known(walked.subject.height_m), known(walked.subject.sex), model.geometry, "dumas"
    )
    parts = intervals(Window(ik.time, motion, loads.sum(axis=1)))
    vector = ParameterVector(bsp, symmetric=True)
    problem, theta = TwoLevelProblem(skeleton, vector, parts, True, 0.5), vector.values(bsp)
    seconds["two-level evaluation"], _ = best(runs, lambda: (problem.residuals(theta), problem.jacobian(theta)))
    seconds["inverse dynamics"], _ = best(runs, lambda: inverse_dynamics(skeleton, bsp, motion, loads))
    return seconds, len(ik.time)


def opensim_ik(name: str) -> float:
    """Return the seconds that OpenSim's InverseKinematicsTool takes for all frames of the walk."""
    setup, model = (str(data_folder() / file) for file in SETUPS[name])
    markers = walk(name).markers
    clock = read_trc(markers).time

    loaded = opensim.Model(model)
    loaded.initSystem()
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        tool = opensim.InverseKinematicsTool(setup, False)
        tool.setModel(loaded)
        tool.setMarkerDataFileName(str(markers))
        tool.setStartTime(float(clock[0]))
        tool.setEndTime(float(clock[-1]))
        tool.setOutputMotionFileName(str(Path(folder) / "ik.mot"))
        tool.setResultsDir(folder)
        os.chdir(folder)
        try:
            return best(1, tool.run)[0]
        finally:
            os.chdir(before)


def foot_labels(marker_set: MarkerSet, markers: Markers) -> dict[str, list[str]]:
    """Return per side the foot's markers that the trial has."""
    return {side: [m for m in labels if m in markers.labels] for side, labels in marker_set.foot_labels().items()}


def both_ik(name: str, runs: int) -> tuple[float, float]:
    """Return seconds per frame of `solve_ik` and of OpenSim, run alternately so that both meet the same load."""
    walked = walk(name)
    recording, static = read_recording(walked.markers, walked.forces, walked.loads), read_recording(walked.static)
    marker_set = choose_marker_set(static.markers.labels)
    feet = foot_labels(marker_set, recording.markers)
    skeleton = calibrate(_model(static, marker_set, walked.subject), [build_trial(recording, feet)]).skeleton
    mine, theirs = [], []
    for _ in range(runs):
        theirs.append(opensim_ik(name))
        mine.append(best(5, lambda: solve_ik(skeleton, read_trc(walked.markers)))[0])
    frames = len(recording.markers.time)
    return min(mine) / frames, min(theirs) / frames


def gcv_splines(frames: int, columns: int, runs: int) -> tuple[float, float]:
    """Return the seconds that `smooth` and OpenSim's GCVSplineSet take to choose the smoothing of noisy sinusoids."""
    rng = np.random.default_rng(0)
    clock = np.arange(frames) / 100
    values = np.sin(2 * np.pi * 1.5 * clock)[:, None] + 0.01 * rng.standard_normal((frames, columns))
    table = opensim.TimeSeriesTable()
    table.setColumnLabels([f"q{k}" for k in range(columns)])
    for moment, row in zip(clock, values, strict=True):
        table.appendRow(float(moment), opensim.RowVector([float(value) for value in row]))

    def theirs() -> None:
        splines = opensim.GCVSplineSet(table, [f"q{k}" for k in range(columns)], 5, -1.0)
        for k in range(columns):
            splines.get(k).calcValue(opensim.Vector(1, 0.01))

    return best(runs, lambda: smooth(clock, values, "gcv"))[0], best(runs, theirs)[0]


def beside_opensim(runs: int, lengths: Sequence[int], names: Sequence[str]) -> tuple[list[list[str]], list[list[str]]]:
    """Measure both programs: rows of tasks next to OpenSim, and of Kinertia's stages by the length of the trial."""
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    peers, scaling = [], []
    with threadpool_limits(limits=1, user_api="blas"), tempfile.TemporaryDirectory() as folder:
        for name in names:
            mine, theirs = both_ik(name, runs)
            peers.append([f"inverse kinematics, {WALKS[name]}", _ms(mine), _ms(theirs), f"{theirs / mine:.0f}"])
            measured = [
                ours(lengthened(walk(name), WINDOW_S[name], k, Path(folder) / f"{name}{k}"), runs) for k in lengths
            ]
            for stage in STAGES:
                per_frame = [seconds[stage] / frames for seconds, frames in measured]
                growth = f"{per_frame[-1] / per_frame[0]:.2f}"
                scaling.append([f"{stage}, {WALKS[name]}", *map(_ms, per_frame), growth])
        for frames in (200 * k for k in lengths):
            mine, theirs = (spent / frames for spent in gcv_splines(frames, 27, runs))
            title = f"quintic GCV splines, 27 columns of {frames} samples"
            peers.append([title, _ms(mine), _ms(theirs), f"{theirs / mine:.1f}"])
    return peers, scaling


def document(runs: int = 5, lengths: Sequence[int] = (1, 2, 4), names: Sequence[str] = tuple(SETUPS)) -> str:
    """Return the text of docs/validation/speed.md, measured now."""
    peers, scaling = beside_opensim(runs, lengths, names)
    return f"""# Speed

Milliseconds per frame, both programs in the same run on the same machine: only the ratios travel to another. All but
the estimate and the command run in one thread; these use a second one where there is a core for it.

## Next to OpenSim {opensim.GetVersion().split("-")[0]}

Inverse kinematics: the same marker file, all frames, reading it included. OpenSim runs its `InverseKinematicsTool` with
the set-up file and scaled model that come with the data (and also writes the motion); Kinertia its 27-DOF model.
Splines: the choice of the smoothing by cross-validation, `smooth` against `GCVSplineSet`.

{table(["task", "Kinertia (ms)", "OpenSim (ms)", "OpenSim / Kinertia"], peers)}

## Cost is linear in the length of the trial

The same walk {" and ".join(f"{k}x" for k in lengths)}, every second time backwards so that nothing jumps. Linear cost
means the same milliseconds per frame in every column, or fewer where a fixed part weighs on the short trial; the last
column is the longest's divided by the shortest's. Calibration looks at ten frames per second of trial, 60 at most. A
two-level evaluation is the residual and its derivative with respect to 49 parameters.

{table(["stage", *(f"{k}x (ms)" for k in lengths), f"{lengths[-1]}x / {lengths[0]}x"], scaling)}

## The rigid-body core next to Pinocchio {pinocchio.__version__}

The package's walk, 27 axes; Pinocchio's calls in a bare loop over the frames, without copying anything out.

{core_section(runs)}

## The estimate

Observation, optimisation and error bars, from coordinates on, of a synthetic walk with skin motion at 100 Hz; bare
calls are Pinocchio's Jacobian, RNEA derivatives and regressor. Most of it is linear algebra: elimination of the
motion, error bars of joint moments.

{speed_section([timed(duration) for duration in ESTIMATED_S])}

## The command

Whole processes with compiled functions in the cache, next to importing what they stand on.

{command_section(runs)}

## The first run on a machine

Kinertia's calculations are compiled once, by as many processes as there are cores.

{first_run_section()}
"""


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.3f}"


def main(runs: Annotated[int, typer.Option(help="The best of so many runs counts.")] = 5) -> None:
    """Measure and write the page."""
    write_page("speed", document(runs))
