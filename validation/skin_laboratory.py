"""Joint moments and error bars where skin moves as it was measured on a person, beside OpenSim's pipeline.

People unlike the model walk the gait2354 walk (`truth_trials`); the markers of their thighs and shanks move as the
donor's did (`measured_skin`). Each walk is fitted alone by `kinertia fit --model`.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import opensim
import pandas as pd

from kinertia.io.text.sto import read_sto
from validation.joint_accuracy import WITHIN
from validation.measured_skin import MeasuredSkin, heel_strikes_s, stride_s
from validation.measured_trials import table
from validation.opensim_runs import inverse_dynamics, inverse_kinematics, quietly, without_forces
from validation.page import write_page
from validation.truth_trials import Faults, gait2354, make_trial

FIRST_SEED = 100
_FAULTY = Faults(plate_m=0.020, lag_s=0.010, hip_m=0.010)
INSTRUMENTS = {"sound": Faults(), "stated": Faults(), "faulty": _FAULTY, "calibrated": _FAULTY}
_SUBJECT = """[subject]
mass_kg = {mass_kg:.1f}

[[trial]]
markers = "walk.trc"
forces = "walk_grf.mot"
loads = "loads.xml"

[model]
osim = "model.osim"
"""
_MORE = {
    "stated": "\n[instruments]\nplate_sd_mm = 0.5\nclock_sd_ms = 0.5\n",
    "calibrated": "calibrate = true\n",
}
"""Entries at the end of the subject file, by kind of laboratory."""
CUTOFFS_HZ = (6, 10, 12)
MARGIN_S = 0.05
LOADING = 0.12
"""Share of the stride, from heel strike, in which the body comes down on the leg."""
JOINTS = {
    "hip_flexion": "hip flexion",
    "hip_adduction": "hip adduction",
    "hip_rotation": "hip rotation",
    "knee_angle": "knee",
    "ankle_angle": "ankle",
    "subtalar_angle": "subtalar",
    "lumbar_extension": "lumbar extension",
    "lumbar_bending": "lumbar bending",
    "lumbar_rotation": "lumbar rotation",
}


@dataclass(frozen=True, eq=False)
class Walk:
    """Results of one person, frame by frame: (n,) of each joint moment's column.

    Attributes:
        errors, sd: errors and SD of the estimate, N m.
        usual: errors of OpenSim's inverse kinematics and inverse dynamics, by cutoff.
        loading: frames of loading response of the leg; none for the back.
        found: instrument errors found by the fit, mm and ms.
    """

    errors: Mapping[str, np.ndarray]
    sd: Mapping[str, np.ndarray]
    usual: Mapping[int, Mapping[str, np.ndarray]]
    loading: Mapping[str, np.ndarray]
    found: Mapping[str, float]


def made(folder: Path, skin: Path, kind: str, seed: int) -> Walk:
    """Make, fit and compare one person's walk, as far as not done yet."""
    if not (folder / "loads.xml").exists():
        make_trial(folder, seed, INSTRUMENTS[kind], gait2354(), MeasuredSkin.read(skin))
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    if not (folder / "fit" / "fit.json").exists():
        subject = folder / "subject.toml"
        text = _SUBJECT.format(mass_kg=truth["total_mass_kg"]) + _MORE.get(kind, "")
        subject.write_text(text, encoding="utf-8")
        words = ["fit", subject, "-o", folder / "fit", "--quiet"]
        subprocess.run([sys.executable, "-m", "kinertia", *map(str, words)], capture_output=True, check=False)
    usual = _opensim(folder, truth["total_mass_kg"])
    return _compared(folder, usual)


def _opensim(folder: Path, mass_kg: float) -> dict[int, pd.DataFrame]:
    """Compute joint moments by OpenSim's IK + ID, with the model scaled to the person's mass."""
    work = folder / "opensim"
    work.mkdir(exist_ok=True)
    model, motion = work / "model.osim", work / "ik.mot"
    if not (work / f"{CUTOFFS_HZ[-1]}.sto").exists():
        with quietly(work / "opensim.log"):
            without_forces(folder / "model.osim", model, mass_kg)
            inverse_kinematics(opensim.Model(str(model)), folder / "walk.trc", motion)
            for hz in CUTOFFS_HZ:
                inverse_dynamics(model, motion, folder / "loads.xml", work / f"{hz}.sto", hz)
    return {hz: read_sto(work / f"{hz}.sto") for hz in CUTOFFS_HZ}


def _compared(folder: Path, usual: Mapping[int, pd.DataFrame]) -> Walk:
    true, fit = read_sto(folder / "truth" / "moments.sto"), folder / "fit"
    found, sd = (read_sto(fit / f"inverse_dynamics{kind}.sto") for kind in ("", "_sd"))
    forces = read_sto(folder / "truth" / "forces.mot")
    time = found.index.to_numpy()
    time = time[(time > time[0] + MARGIN_S) & (time < time[-1] - MARGIN_S)]
    names = [name for name in map(str, true) if joint_of(name) and name in found]

    def at(moments: pd.DataFrame, name: str) -> np.ndarray:
        return np.interp(time, moments.index, moments[name])

    def down(name: str) -> np.ndarray:
        side = name.removesuffix("_moment")[-2:]
        if side not in ("_r", "_l"):
            return np.zeros(len(time), dtype=bool)
        since: np.ndarray = (time - heel_strikes_s(forces, side[1:])[0]) / stride_s(forces) % 1.0
        return since < LOADING

    calibration = json.loads((fit / "fit.json").read_text())["calibration"]
    return Walk(
        {name: at(found, name) - at(true, name) for name in names},
        {name: at(sd, name) for name in names},
        {hz: {name: at(outputs, name) - at(true, name) for name in names} for hz, outputs in usual.items()},
        {name: down(name) for name in names},
        _instruments(calibration),
    )


def joint_of(column: str) -> str | None:
    """Return the joint of a column, one of JOINTS."""
    return next((joint for joint in JOINTS if column.startswith(joint)), None)


def _instruments(calibration: Sequence[Mapping[str, object]]) -> dict[str, float]:
    """Return the displacement of the left plate along the walk (mm), and the delay of the forces (ms)."""
    result = {}
    for entry in calibration:
        value = 1e3 * float(str(entry["value"]))
        if entry["quantity"] == "position" and entry["axis"] == "x" and str(entry["plate"]).startswith("left"):
            result["plate"] = value
        if entry["quantity"] == "delay" and entry["trial"] is None:
            result["delay"] = value
    return result


def _pooled(walks: Sequence[Walk], joint: str, kind: str, where: str | None = None) -> np.ndarray:
    """Return values of all columns of a joint in all walks."""
    values = []
    for walk in walks:
        part = getattr(walk, kind) if kind in ("errors", "sd") else walk.usual[int(kind)]
        for name in part:
            if joint_of(name) == joint:
                values.append(part[name][walk.loading[name]] if where else part[name])
    return np.concatenate(values)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.square(values).mean()))


def joint_row(walks: Sequence[Walk], joint: str) -> list[str]:
    """Return errors, bars and coverage of one joint."""
    errors, sd = (_pooled(walks, joint, kind) for kind in ("errors", "sd"))
    best = min(_rms(_pooled(walks, joint, str(hz))) for hz in CUTOFFS_HZ)
    cells = [f"{value:.2f}" for value in (_rms(errors), best, _rms(errors) / best, _rms(sd))]
    cells.append(_covered(errors, sd))
    early, early_sd = (_pooled(walks, joint, kind, "loading") for kind in ("errors", "sd"))
    return [JOINTS[joint], *cells, *([f"{_rms(early):.2f}", _covered(early, early_sd)] if len(early) else ["", ""])]


def _covered(errors: np.ndarray, sd: np.ndarray) -> str:
    return f"{100.0 * np.mean(np.abs(errors) < WITHIN * sd):.0f} %"


def joints_table(walks: Sequence[Walk]) -> str:
    """Return errors, bars and coverage per joint."""
    heads = ["N m", "estimate", "OpenSim", "ratio", "sd", "covered", "after heel strike", "covered"]
    return table(heads, [joint_row(walks, joint) for joint in JOINTS])


def instruments_text(walks: Sequence[Walk], faults: Faults) -> str:
    """Describe the estimates of the injected plate displacement and delay."""
    wrong = {"plate": 1e3 * faults.plate_m, "delay": 1e3 * faults.lag_s}
    limits = {"plate": (4.0, "mm"), "delay": (2.0, "ms")}
    said = []
    for what, (limit, unit) in limits.items():
        off = np.array([walk.found.get(what, 0.0) - wrong[what] for walk in walks])
        said.append(
            f"{what}, {wrong[what]:.0f} {unit}: found to {_rms(off):.1f} {unit} (RMS), "
            f"within {limit:.0f} {unit} in {np.sum(np.abs(off) <= limit)} of {len(off)} people"
        )
    return "; ".join(said)


def document(people: Mapping[str, Sequence[Walk]]) -> str:
    """Return the text of docs/validation/measured-skin.md."""
    count = len(people["sound"])
    parts = {f"{kind}_table": joints_table(walks) for kind, walks in people.items()}
    parts |= {kind: instruments_text(walks, INSTRUMENTS[kind]) for kind, walks in people.items()}
    return TEXT.format(people=count, first=FIRST_SEED, **parts)


TEXT = """# Skin as measured on a person

OpenSim alone made these walks (`validation/truth_trials.py`): the gait2354 walk, walked by {people} people for each
table (seeds from {first}) whose body segment parameters differ from the model's. The markers of thighs and shanks move
over the bone as one walking person's did against fluoroscopy (`validation/measured_skin.py`); all people have the skin
of this one donor. The recording does not come with Kinertia: `python -m validation accuracy --skin FILE` takes it.

*Estimate*: RMS error of the joint moments by `kinertia fit`, with the model, each walk alone. *OpenSim*: of its inverse
kinematics and inverse dynamics at the best of 6, 10 and 12 Hz for each joint. *sd*: RMS of the deviations that the fit
reports. *Covered*: share of frames in which the truth lies in the 95 % interval. *After heel strike*: the first 12 % of
each side's strides.

## Sound instruments

{sound_table}

Instruments: {sound}.

The same walks, with a subject file that states what OpenSim takes for granted, that plates and synchronisation are
right (`plate_sd_mm = 0.5`, `clock_sd_ms = 0.5`):

{stated_table}

## Left plate 20 mm off, forces 10 ms late, hip centres 10 mm off

The model as it is, which takes its hip centres for exact:

{faulty_table}

Instruments: {faulty}.

With `--calibrate`, which lets joint centres and markers move:

{calibrated_table}

Instruments: {calibrated}.
"""


def measure(skin: Path, people: int, keep: Path | None = None, workers: int = 2) -> None:
    """Make the page on measured skin motion.

    Args:
        skin: file of `measured_skin`.
        people: number of people with each kind of instruments.
        keep: folder for walks and results, which are used again.
        workers: number of walks at a time.
    """
    with tempfile.TemporaryDirectory() as temporary:
        work = keep.resolve() if keep else Path(temporary)
        walks = {}
        for kind in INSTRUMENTS:
            folders = [work / f"{kind}{FIRST_SEED + k}" for k in range(people)]
            measure_one = partial(_one, skin, kind)
            with ThreadPoolExecutor(workers) as pool:
                list(pool.map(measure_one, folders))
            walks[kind] = [made(f, skin, kind, int(f.name.removeprefix(kind))) for f in folders]
        write_page("measured-skin", document(walks), "accuracy --skin FILE")


def _one(skin: Path, kind: str, folder: Path) -> None:
    """Make one walk in a separate process: OpenSim does not free its memory."""
    seed = folder.name.removeprefix(kind)
    words = [str(folder), str(skin), kind, seed]
    subprocess.run([sys.executable, "-m", "validation.skin_laboratory", *words], check=True)


if __name__ == "__main__":
    made(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], int(sys.argv[4]))
