"""Walks of known truth in laboratories that measure some of the steps, and the errors of their joint moments."""

import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import opensim
import pandas as pd
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, filtfilt

from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.io.text.sto import read_sto, write_sto
from kinertia.motion.joint_moments import joint_and_side
from kinertia.workflow.from_files import fit_subject
from validation.measured_skin import MeasuredSkin
from validation.opensim_runs import inverse_kinematics, quietly, radians, without_forces
from validation.truth_moments import Course, three_dimensional_moments
from validation.truth_person import SIDES, Person
from validation.truth_trials import Faults, Spline, disturbed, gait2354, make_trial
from validation.wrong_knees import displace_knees

LOADED_N = 5.0
USUAL_HZ = 6.0
_ORDER = 3
_MARGIN_S = 0.05
"""Left out at both ends of the recording."""
_SUBJECT = """[subject]
mass_kg = {mass_kg:.1f}

[[trial]]
markers = "../walk.trc"
forces = "walk_grf.mot"
loads = "../loads.xml"

[model]
osim = "{model}"
"""


_SOUND = Faults()


@dataclass(frozen=True)
class Laboratory:
    """What a laboratory measures of a walk.

    Attributes:
        steps: number of steps on plates, a right and then a left one; None for all.
        faults: of its instruments.
        wrong_knees: whether the model's knees are displaced.
        measured_skin: whether skin moves as it was measured on a person, not linearly with joint angles.
    """

    steps: int | None
    faults: Faults = _SOUND
    wrong_knees: bool = False
    measured_skin: bool = False


LABORATORIES = {
    "all steps": Laboratory(None),
    "two steps": Laboratory(2),
    "one step": Laboratory(1),
    "instruments off": Laboratory(2, Faults(plate_m=0.020, lag_s=0.010)),
    "knees wrong": Laboratory(2, wrong_knees=True),
    "measured skin, all steps": Laboratory(None, measured_skin=True),
    "measured skin, two steps": Laboratory(2, measured_skin=True),
    "measured skin, one step": Laboratory(1, measured_skin=True),
}


def person_errors(seed: int, skin: Path | None) -> pd.DataFrame:
    """Return the errors of one person in all laboratories; without a file of measured skin in those of linear skin.

    Rows are frames of a component: `laboratory`, `what` ("knee adduction"), `where` ("inside": all ground contact is on
    plates; else "stance" or "swing" of the leg, "outside" for the back), and the errors (N m) `error`, of Kinertia with
    all steps (`all_steps`) and of OpenSim (`usual`), with Kinertia's standard deviation `sd`.
    """
    with tempfile.TemporaryDirectory() as temporary:
        folders = {"linear": Path(temporary) / "linear"} | ({"measured": Path(temporary) / "measured"} if skin else {})
        for kind, folder in folders.items():
            donor = MeasuredSkin.read(skin) if skin and kind == "measured" else None
            make_trial(folder, seed, Faults(), gait2354(), donor)
        with quietly(Path(temporary) / "opensim.log"):
            truth = true_moments(folders["linear"])
            parts, complete = [], {}
            for name, laboratory in LABORATORIES.items():
                walk = folders.get("measured" if laboratory.measured_skin else "linear")
                if walk is not None:
                    found = _errors(walk, seed, laboratory, truth)
                    if laboratory.steps is None:
                        complete[laboratory.measured_skin] = found["error"]
                    found["all_steps"] = complete[laboratory.measured_skin].reindex(found.index)
                    parts.append(found.reset_index().assign(laboratory=name, seed=seed))
    return pd.concat(parts, ignore_index=True)


def true_moments(walk: Path) -> pd.DataFrame:
    """Return the true moments (N m) over time (s) of a truth trial; columns as in `joint_moments.sto`."""
    model = opensim.Model(str(walk / "truth" / "model.osim"))
    q = radians(model, walk / "truth" / "ik.mot")
    motion = Spline(q.index.to_numpy(), q.to_numpy())
    time = read_sto(walk / "truth" / "motion.mot").index.to_numpy()
    return three_dimensional_moments(Person(model), motion, read_sto(walk / "truth" / "forces.mot"), time)


def _errors(walk: Path, seed: int, laboratory: Laboratory, truth: pd.DataFrame) -> pd.DataFrame:
    """Fit the walk in one laboratory and compare; the index is component, side and time."""
    with tempfile.TemporaryDirectory(dir=walk) as temporary:
        folder, model = Path(temporary), walk / "model.osim"
        if laboratory.wrong_knees:
            model = folder / "model.osim"
            model.write_bytes((walk / "model.osim").read_bytes())
            displace_knees(model, seed)
        true_forces = read_sto(walk / "truth" / "forces.mot")
        forces = disturbed(true_forces, laboratory.faults)
        shown = steps_on_plates(forces, laboratory.steps)
        write_sto(folder / "walk_grf.mot", shown, False, "walk_grf")
        mass_kg = float(pd.read_json(walk / "truth" / "truth.json", typ="series")["total_mass_kg"])
        subject = folder / "subject.toml"
        text = _SUBJECT.format(mass_kg=mass_kg, model=Path(os.path.relpath(model, folder)).as_posix())
        subject.write_text(text, encoding="utf-8")
        trial = fit_subject(subject).trials[0]
        values, sd = estimated_moments(trial)
        time = values.index.to_numpy()
        usual = _usual_moments(walk / "walk.trc", model, mass_kg, forces, time, folder)
    measured = np.isin(np.round(time, 6), np.round(trial.time, 6))
    return compared(values, sd, truth, usual, measured, true_forces)


def estimated_moments(trial: TrialFit) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return estimated moments and their standard deviations (N m) over time (s); columns as in `joint_moments.sto`."""
    curves = trial.joint_curves
    assert curves is not None
    assert curves.moment_sd is not None
    loads = curves.joints["estimate"]
    names, index = list(loads.names), pd.Index(curves.time, name="time")
    values, sd = (samples.reshape(len(index), -1) for samples in (loads.moments, curves.moment_sd))
    return pd.DataFrame(values, index, names), pd.DataFrame(sd, index, names)


def compared(
    values: pd.DataFrame,
    sd: pd.DataFrame,
    truth: pd.DataFrame,
    usual: pd.DataFrame,
    measured: np.ndarray,
    forces: pd.DataFrame,
) -> pd.DataFrame:
    """Compare moments with the truth, where there are any; the index is component, side and time.

    Args:
        values, sd, usual: over the same (n,) times, NaN where not known; columns as in `joint_moments.sto`.
        truth: over any times.
        measured: (n,) whether all ground contact is on plates.
        forces: of all steps, without faults.
    """
    time, parts = values.index.to_numpy(), []
    within = (time > truth.index[0] + _MARGIN_S) & (time < truth.index[-1] - _MARGIN_S)
    for name in values:
        joint, _, component = str(name).rpartition("_")
        joint, side = joint_and_side(joint)
        if side:
            loaded = np.interp(time, forces.index, forces[f"ground_force_{side}_vy"]) > LOADED_N
            outside = np.where(loaded, "stance", "swing")
        else:
            outside = np.full(len(time), "outside")
        true = np.interp(time, truth.index, truth[name])
        rows = {
            "what": f"{joint} {component}",
            "side": side,
            "time": np.round(time, 6),
            "where": np.where(measured, "inside", outside),
            "error": values[name].to_numpy() - true,
            "sd": sd[name].to_numpy(),
            "usual": usual[name].to_numpy() - true,
            "true": true,
        }
        parts.append(pd.DataFrame(rows)[within].dropna(subset="error"))
    return pd.concat(parts).set_index(["what", "side", "time"])


def steps_on_plates(forces: pd.DataFrame, steps: int | None) -> pd.DataFrame:
    """Return the forces with one right step and the next left one on plates (2), the right one only (1), or all (None).

    The right step is the first whose left one after it is whole in the recording.
    """
    if steps is None:
        return forces
    contacts = {side: _whole_contacts(forces, side) for side in SIDES}
    pairs = [(contact, next((two for two in contacts["l"] if two[0] > contact[0]), None)) for contact in contacts["r"]]
    right, left = next((first, two) for first, two in pairs if two is not None)
    result = forces
    for side, kept in zip(SIDES, (right, left if steps > 1 else None), strict=True):
        rows = np.ones(len(forces), dtype=bool)
        if kept is not None:
            rows[kept[0] : kept[1]] = False
        of_side = forces.columns.str.contains(f"_{side}_")
        result = result.mask(rows[:, None] & of_side, 0.0)
    return result


def _whole_contacts(forces: pd.DataFrame, side: str) -> list[tuple[int, int]]:
    """Return the rows from touch-down to toe-off (exclusive) of contacts that begin and end within the recording."""
    loaded = np.diff((forces[f"ground_force_{side}_vy"] > 0.0).to_numpy().astype(int))
    begins, ends = np.flatnonzero(loaded > 0) + 1, np.flatnonzero(loaded < 0) + 1
    return [(begin, int(ends[ends > begin][0])) for begin in begins.tolist() if (ends > begin).any()]


def _usual_moments(
    markers: Path, model: Path, mass_kg: float, forces: pd.DataFrame, time: np.ndarray, folder: Path
) -> pd.DataFrame:
    """Compute the moments that OpenSim's inverse kinematics, low-passed, and the model's own parameters give."""
    scaled, motion = folder / "scaled.osim", folder / "ik.mot"
    without_forces(model, scaled, mass_kg)
    inverse_kinematics(opensim.Model(str(scaled)), markers, motion)
    posed = opensim.Model(str(scaled))
    return three_dimensional_moments(Person(posed), _low_passed(radians(posed, motion)), forces, time)


def _low_passed(q: pd.DataFrame) -> Course:
    """Return splines through zero-lag Butterworth filtered coordinates."""
    time = q.index.to_numpy()
    rate_hz = 1.0 / float(np.median(np.diff(time)))
    numerator, denominator = butter(_ORDER, USUAL_HZ / (rate_hz / 2.0))
    spline = make_interp_spline(time, filtfilt(numerator, denominator, q.to_numpy(), axis=0), 5)
    return lambda when: [spline(when, nu=order) for order in range(3)]


def pooled(errors: pd.DataFrame) -> Mapping[tuple[str, str, str], Mapping[str, float]]:
    """Return RMS errors, standard deviations and coverage per laboratory, place and component."""
    groups = errors.groupby(["laboratory", "where", "what"], sort=False)
    return {tuple(map(str, key)): summary(rows) for key, rows in groups}  # type: ignore[misc]


def summary(rows: pd.DataFrame) -> dict[str, float]:
    """Return what the tables show of some frames."""

    def rms(name: str) -> float:
        return float(np.sqrt(np.square(rows[name]).mean()))

    covered = float((rows["error"].abs() < 1.959964 * rows["sd"]).mean())
    return {name: rms(name) for name in ("error", "sd", "usual", "all_steps", "true")} | {
        "covered": covered,
        "frames": float(len(rows)),
    }
