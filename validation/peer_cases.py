"""The walks of docs/validation/peers.md, and what OpenSim and Kinertia make of each: files in one folder per walk."""

import contextlib
import io
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import opensim
import pandas as pd

from kinertia.cli.commands import main as kinertia
from kinertia.io.text.sto import read_sto
from kinertia.io.text.trc import read_trc
from validation.measured_data import data_folder
from validation.opensim_rra import Reduced, RRAFailed, reduce_residuals
from validation.opensim_runs import (
    inverse_dynamics,
    inverse_kinematics,
    marker_rms_m,
    quietly,
    setup_weights,
    with_forces_file,
    without_forces,
)
from validation.truth_trials import Faults, gait2354, make_trial

CUTOFFS_HZ = (6, 10, 12)
FAULTS = Faults(plate_m=0.020, lag_s=0.010, hip_m=0.010)
MARGIN_S = 0.05
"""Time left out at both ends of the window that Kinertia uses: the ends of splines and filters."""


@dataclass(frozen=True)
class Case:
    """One walk as every program receives it."""

    title: str
    folder: Path
    model: Path
    markers: Path
    forces: Path
    loads: Path
    mass_kg: float
    fits: dict[str, tuple[str, ...]]
    """Per name of a fit, the options of `kinertia fit` that are not always given."""
    ik_setup: Path | None = None
    truth: Path | None = None


@dataclass
class Result:
    """Results of one program for a case."""

    seconds: float = np.nan
    moments: dict[int, pd.DataFrame] = field(default_factory=dict)
    """Joint moments per cutoff of the coordinates (Hz; 0: as the program has them)."""
    opensim: pd.DataFrame | None = None
    """OpenSim's inverse dynamics of the delivered files, forces unfiltered."""
    marker_rms_m: float = np.nan
    failed: str = ""


def truth_case(folder: Path, seed: int, faulty: bool) -> Case:
    """Return a truth trial, which is made if it does not exist yet."""
    folder = folder / f"{'faulty' if faulty else 'sound'}{seed}"
    if not (folder / "loads.xml").exists():
        make_trial(folder, seed, FAULTS if faulty else Faults(), gait2354())
    mass = json.loads((folder / "truth" / "truth.json").read_text())["total_mass_kg"]
    model, walk, forces, loads = (folder / name for name in ("model.osim", "walk.trc", "walk_grf.mot", "loads.xml"))
    fits: dict[str, tuple[str, ...]] = {"calibrated": ("--calibrate",)} if faulty else {"default": ()}
    return Case(folder.name, folder, model, walk, forces, loads, mass, fits, truth=folder / "truth" / "moments.sto")


def measured_cases(folder: Path) -> dict[str, Case]:
    """Return the two measured walks that come with scaled OpenSim models."""
    data, fits = data_folder(), {"default": (), "calibrated": ("--calibrate",)}
    gait, rajagopal = data / "gait2354", data / "rajagopal_walk"
    cases = {
        "gait2354": Case(
            "gait2354 walk", folder / "gait2354", gait / "subject01_scaled.osim", gait / "subject01_walk1.trc",
            gait / "subject01_walk1_grf.mot", gait / "subject01_walk1_grf.xml", 72.6, fits,
            gait / "subject01_Setup_IK.xml",
        ),
        "rajagopal": Case(
            "Rajagopal walk", folder / "rajagopal", rajagopal / "scaled.osim", rajagopal / "motion_capture_walk.trc",
            rajagopal / "grf_walk.mot", rajagopal / "grf_walk.xml", 85.0, fits, rajagopal / "ik_setup_walk.xml",
        ),
    }  # fmt: skip
    for case in cases.values():
        case.folder.mkdir(exist_ok=True)
    return cases


@contextlib.contextmanager
def timed(result: Result) -> Iterator[None]:
    """Add the elapsed time of the block to the result."""
    started = time.perf_counter()
    yield
    spent = time.perf_counter() - started
    result.seconds = spent if np.isnan(result.seconds) else result.seconds + spent


def fit(case: Case, name: str) -> tuple[Result, Path]:
    """Run `kinertia fit --model`; return its result and folder."""
    out, result = case.folder / name, Result()
    arguments = ["fit", case.markers, "--forces", case.forces, "--loads", case.loads, "--model", case.model]
    arguments += ["--mass", case.mass_kg, *case.fits[name], "--quiet", "-o", out]
    # the exit status says that a check of the result failed; the page shows the numbers
    with timed(result), contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        kinertia([str(argument) for argument in arguments])
    result.moments[0] = read_sto(out / "inverse_dynamics.sto")
    return result, out


def window_s(out: Path) -> tuple[float, float]:
    """Return the window of the walk that a fit used."""
    start, end = json.loads((out / "fit.json").read_text())["trials"][0]["window_s"]
    return float(start), float(end)


def frames(out: Path) -> np.ndarray:
    """Return the times of the frames that count: those that a fit used, without the ends."""
    time, (start, end) = read_sto(out / "inverse_dynamics.sto").index.to_numpy(), window_s(out)
    return time[(time > start + MARGIN_S) & (time < end - MARGIN_S)]


def delivered(case: Case, result: Result, out: Path) -> None:
    """Add OpenSim's inverse dynamics and marker errors of what Kinertia exported."""
    work = case.folder / f"opensim_{out.name}"
    work.mkdir(exist_ok=True)
    with quietly(work / "opensim.log"):
        without_forces(out / "model.osim", work / "model.osim")
        loads = out / "external_loads.xml"
        result.opensim = inverse_dynamics(work / "model.osim", out / "kinematics.mot", loads, work / "moments.sto")
        result.marker_rms_m = marker_errors(case, out / "model.osim", out / "kinematics.mot", frames(out))


def opensim_default(case: Case, time: np.ndarray) -> Result:
    """Run OpenSim's inverse kinematics and inverse dynamics, with the model scaled to the person's mass."""
    work, result = case.folder / "opensim", Result()
    work.mkdir(exist_ok=True)
    model, motion = work / "model.osim", work / "ik.mot"
    with quietly(work / "opensim.log"):
        without_forces(case.model, model, case.mass_kg)
        with_forces_file(case.loads, case.forces, work / "loads.xml")
        with timed(result):
            weights = setup_weights(case.ik_setup) if case.ik_setup else None
            inverse_kinematics(opensim.Model(str(model)), case.markers, motion, weights)
            result.moments[6] = inverse_dynamics(model, motion, work / "loads.xml", work / "6.sto", 6)
        for cutoff in CUTOFFS_HZ[1:] if case.truth else ():
            out = work / f"{cutoff}.sto"
            result.moments[cutoff] = inverse_dynamics(model, motion, work / "loads.xml", out, cutoff)
        result.marker_rms_m = marker_errors(case, model, motion, time)
    result.opensim = result.moments[6]
    return result


def opensim_rra(case: Case, span_s: tuple[float, float], time: np.ndarray) -> Result:
    """Run OpenSim's RRA after `opensim_default`; a finished run in the case's folder is reused."""
    work, folder, result = case.folder / "opensim", case.folder / "rra", Result()
    done = folder / "done.json"
    try:
        with quietly(work / "opensim.log"):
            if done.exists():
                result.seconds = json.loads(done.read_text())["seconds"]
                reduced = Reduced(folder / "applied.osim", folder / "rra.mot")
            else:
                with timed(result):
                    reduced = reduce_residuals(work / "model.osim", work / "ik.mot", work / "loads.xml", span_s, folder)
                done.write_text(json.dumps({"seconds": result.seconds}))
            moments = inverse_dynamics(reduced.model, reduced.motion, work / "loads.xml", folder / "moments.sto")
            result.marker_rms_m = marker_errors(case, reduced.model, reduced.motion, time)
    except RRAFailed as failure:
        return Result(failed=str(failure))
    result.moments[0] = result.opensim = moments
    return result


def marker_errors(case: Case, model: Path, motion: Path, time: np.ndarray) -> float:
    """Compute the RMS distance of the markers that inverse kinematics uses."""
    return marker_rms_m(model, motion, case.markers, time, used_markers(case))


def used_markers(case: Case) -> list[str]:
    """Return markers of the model that were recorded and, where there is a set-up file, that it uses."""
    model = opensim.Model(str(case.model))
    known = [model.getMarkerSet().get(k).getName() for k in range(model.getMarkerSet().getSize())]
    weights = setup_weights(case.ik_setup) if case.ik_setup else dict.fromkeys(known, 1.0)
    recorded = read_trc(case.markers).labels
    return [name for name in known if name in recorded and name in weights]


def results(case: Case) -> dict[str, Any]:
    """Return all results of one case: a `Result` per program, and the frames that count."""
    fits = {name: fit(case, name) for name in case.fits}
    out = next(iter(fits.values()))[1]
    time = frames(out)
    for result, where in fits.values():
        delivered(case, result, where)
    default = opensim_default(case, time)
    reduced = opensim_rra(case, window_s(out), time)
    return {"time": time, "opensim": default, "rra": reduced, **{name: result for name, (result, _) in fits.items()}}
