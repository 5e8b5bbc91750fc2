"""Tell what fits with users' OpenSim models give."""

import contextlib
import io
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from kinertia.cli.commands import main as kinertia
from validation.measured_data import data_folder
from validation.measured_trials import STAGES, farthest, messages_of, table
from validation.page import write_page


@dataclass(frozen=True)
class Person:
    """A person with their own model; files without extension, relative to the data."""

    title: str
    mass_kg: float
    model: str
    trials: dict[str, tuple[str, str]]
    """Per marker file: forces and ExternalLoads."""


PEOPLE = {
    "gait2354": Person(
        "gait2354",
        72.6,
        "gait2354/subject01_scaled",
        {"gait2354/subject01_walk1": ("gait2354/subject01_walk1_grf", "gait2354/subject01_walk1_grf")},
    ),
    "rajagopal": Person(
        "Rajagopal",
        85.0,
        "rajagopal_walk/scaled",
        {"rajagopal_walk/motion_capture_walk": ("rajagopal_walk/grf_walk", "rajagopal_walk/grf_walk")},
    ),
    "subject4": Person(
        "subject4",
        60.0,
        "subject4/addbiomechanics_scaled",
        {
            f"subject4/{name}": (f"subject4/{name}_grf", f"subject4/{name}_external_forces")
            for name in ("walking1", "walking2", "squats1")
        },
    ),
}


def subject_file(data: Path, person: Person, calibrate: bool) -> str:
    """Return the subject file (TOML) of one person."""
    lines = ["[subject]", f"mass_kg = {person.mass_kg}", "[model]", f'osim = "{data / person.model}.osim"']
    lines += ["calibrate = true"] if calibrate else []
    for markers, (forces, loads) in person.trials.items():
        lines += ["[[trial]]", f'markers = "{data / markers}.trc"']
        lines += [f'forces = "{data / forces}.mot"', f'loads = "{data / loads}.xml"']
    return "\n".join(lines) + "\n"


def results(name: str, calibrate: bool, folder: Path) -> dict[str, Any]:
    """Return fit.json of one person, with the BSP table under "bsp"."""
    folder.mkdir()
    subject = folder / f"{name}.toml"
    subject.write_text(subject_file(data_folder(), PEOPLE[name], calibrate))
    # the exit status says that a check of the result failed; the page says which
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        kinertia(["fit", str(subject), "-o", str(folder / "out")])
    return {**json.loads((folder / "out" / "fit.json").read_text()), "bsp": pd.read_csv(folder / "out" / "bsp.csv")}


def document(runs: dict[tuple[str, bool], dict[str, Any]]) -> str:
    """Return the text of docs/validation/osim-models.md."""
    rows, bodies, warnings = [], [], []
    for (name, calibrate), run in runs.items():
        title = f"{PEOPLE[name].title}, {'calibrated' if calibrate else 'as it is'}"
        rows += [_trial_row(title, trial) for trial in run["trials"]]
        bodies.append(_body_row(title, run))
        warnings += [f"- {title}: {message}" for message in messages_of(run)]
    residuals = table(
        ["model, trial", "frames", "markers, IK (mm)", "markers, estimate (mm)"]
        + [f"{unit}, {stage}" for unit in ("N", "N m") for stage in ("model", *STAGES[1:])],
        rows,
    )
    estimates = table(
        ["model", "steps", "converged", "scale (kg)", "estimate (kg)", "parameters beyond 3 sd", "farthest (sd)", "s"],
        bodies,
    )
    return TEXT.format(residuals=residuals, estimates=estimates, warnings="\n".join(warnings))


def _trial_row(title: str, trial: dict[str, Any]) -> list[str]:
    markers = [f"{trial['marker_rms_m'][stage] * 1e3:.1f}" for stage in ("ik", "final")]
    residuals = [
        f"{trial[key][stage]:.1f}" for key in ("residual_force_rms_N", "residual_moment_rms_Nm") for stage in STAGES
    ]
    return [f"{title}: {trial['name']}", str(trial["n_dynamic_frames"]), *markers, *residuals]


def _body_row(title: str, run: dict[str, Any]) -> list[str]:
    bsp = run["bsp"].query("prior_sd > 0")
    beyond = ((bsp["estimate"] - bsp["literature"]).abs() > 3 * bsp["prior_sd"]).sum()
    mass = run["total_mass_kg"]
    seconds = sum(trial["seconds"]["total"] for trial in run["trials"])
    converged = "yes" if run["converged"] else "no"
    cells = [title, str(run["iterations"]), converged, f"{mass['measured']:.1f}", f"{mass['estimate']:.1f}"]
    return [*cells, str(beyond), farthest(bsp), f"{seconds:.0f}"]


TEXT = """# OpenSim models

What `kinertia fit --model` gives with three models as their users have them: gait2354 and Rajagopal's, scaled by
OpenSim, and subject4's, scaled by AddBiomechanics (two walks and a series of squats pooled).

*As it is*: markers and joints stay where the model has them; the estimate knows how far off they are. *Calibrated*
(`--calibrate`): markers, and the centres of joints that turn about three axes (hips, back, shoulders), may move. Plates
and synchronisation are calibrated in both.

## Residual at the root, and markers

RMS over the frames used. *Model*: the model's own body segment parameters (at the mass on the scale) on the smoothed
motion. *Corrected*: the same with pelvis correction. *Estimate*: motion, parameters and calibration together.

{residuals}

## Body segment parameters

Prior SDs (sd) are those of `kinertia.estimation.prior` around the model's own parameters. Each parameter beyond
three of them has its warning below. Seconds are this machine's.

{estimates}

## Warnings given

{warnings}
"""


def main() -> None:
    """Write the page."""
    with tempfile.TemporaryDirectory() as folder:
        runs = {
            (name, calibrate): results(name, calibrate, Path(folder) / f"{name}{calibrate}")
            for name in PEOPLE
            for calibrate in (False, True)
        }
    write_page("osim-models", document(runs))
