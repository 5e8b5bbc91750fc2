"""Makes the package's synthetic walk: `src/kinertia/data/standing.csv` and `walk.csv`, from the measured gait2354 walk.

The walk is a truncated Fourier series of every coordinate, fitted to the inverse kinematics of two treadmill strides of
OpenSim's gait2354 example, with the belt's speed added to the forward translation. The standing person is the model of the same
subject, adapted to the walk, put into a standing pose.

    python benchmarks/synthetic_walk_table.py ../shared/data
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from kinertia.config import Subject
from kinertia.contacts import build_trial
from kinertia.fit import calibrate
from kinertia.io.recording import read_recording
from kinertia.kinematics import solve_kinematics
from kinertia.marker_set import read_marker_set
from kinertia.trial import Trial, runs

HARMONICS = 8
STANDING = {"elbow_flex_r": 1.2, "elbow_flex_l": 1.2, "arm_add_r": -0.25, "arm_add_l": -0.25}
DATA = Path(__file__).parents[1] / "src" / "kinertia" / "data"


def basis(time: np.ndarray, period_s: float) -> np.ndarray:
    """(n, 1 + 2 h): constant, then cosine and sine of every harmonic."""
    angle = 2 * np.pi * np.outer(time / period_s, np.arange(1, HARMONICS + 1))
    pairs = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(time), -1)
    return np.column_stack([np.ones(len(time)), pairs])


def main(shared: Path) -> None:
    """Fit and write both tables."""
    folder = shared / "gait2354"
    static = read_recording(folder / "subject01_static.trc")
    walk = read_recording(folder / "subject01_walk1.trc", folder / "subject01_walk1_grf.mot")
    marker_set = read_marker_set("cleveland-clinic")
    present = {s: [m for m in labels if m in walk.markers.labels] for s, labels in marker_set.foot_labels().items()}
    trial = build_trial(walk, present)
    subject = Subject(name="walker", sex="male", mass_kg=72.6, height_m=1.803)
    skeleton = calibrate(static, [trial], marker_set, subject, "bell")[1]
    kinematics = solve_kinematics(skeleton, trial, 0.0, 8.0)
    time, q = kinematics.time, kinematics.motion.q

    def misfit(period_s: float) -> float:
        return float(np.square(q - basis(time, period_s) @ np.linalg.lstsq(basis(time, period_s), q)[0]).sum())

    period_s = float(minimize_scalar(misfit, bounds=(1.0, 1.5), method="bounded").x)
    coefficients = np.linalg.lstsq(basis(time, period_s), q)[0]
    rms = np.sqrt(np.mean(np.square(q - basis(time, period_s) @ coefficients), axis=0))
    contacts = _contacts(trial.loads.time, trial.loads.force[:, :, 1], period_s)
    speed = _belt_speed(trial)
    header = [
        "# Joint coordinates of a walk (rad, m) as Fourier series over one stride. Value at time t: mean, plus for every h",
        "# cos_h cos(2 pi h t / period) and sin_h sin(2 pi h t / period); pelvis_tx moves on at the walking speed.",
        "# Fitted by benchmarks/synthetic_walk_table.py to two treadmill strides of OpenSim's gait2354 example",
        f"# (opensim-models, Pipelines/Gait2354_Simbody, subject01_walk1); RMS misfit {np.degrees(rms[3:]).mean():.2f} deg, "
        f"{rms[:3].max() * 1e3:.1f} mm.",
        f"# period_s = {period_s:.4f}",
        f"# speed_m_s = {speed:.3f}",
        "# contact_r = {:.3f}, {:.3f}".format(*contacts[0]),
        "# contact_l = {:.3f}, {:.3f}".format(*contacts[1]),
    ]
    columns = ["mean"] + [f"{kind}_{h}" for h in range(1, HARMONICS + 1) for kind in ("cos", "sin")]
    table = pd.DataFrame(coefficients.T, index=pd.Index(skeleton.coordinates, name="coordinate"), columns=columns)
    table.loc["pelvis_tx", "mean"] = table.loc["pelvis_tz", "mean"] = 0.0
    _write(DATA / "walk.csv", header, table, "%.7f")

    stand = np.zeros(len(skeleton.coordinates))
    for name, value in STANDING.items():
        stand[skeleton.coordinates.index(name)] = value
    positions = skeleton.marker_positions(skeleton.pose(stand[None]))[0]
    feet = [i for i, m in enumerate(skeleton.markers) if m.segment.startswith("foot")]
    ankle = static.markers.positions[:, [static.markers.labels.index(skeleton.labels[i]) for i in feet], 1]
    positions[:, 1] += np.median(ankle) - np.median(positions[feet, 1])
    header = [
        "# Markers (m; X forward, Y up, Z right) of the synthetic walker standing: the gait2354 subject (72.6 kg, 1.803 m),",
        "# made by benchmarks/synthetic_walk_table.py.",
    ]
    table = pd.DataFrame(positions, index=pd.Index(skeleton.labels, name="label"), columns=["x", "y", "z"])
    _write(DATA / "standing.csv", header, table, "%.5f")
    print("\n".join(header), f"period {period_s:.4f} s, speed {speed:.3f} m/s, contacts {contacts}")


def _contacts(time: np.ndarray, vertical: np.ndarray, period_s: float) -> list[tuple[float, float]]:
    """Start and end of contact of each foot, in shares of the stride."""
    found = []
    for foot in range(2):
        whole = [(a, b) for a, b in runs(vertical[:, foot] > 20.0) if a > 0 and b < len(time) - 1]
        start, end = whole[0]
        found.append(((time[start] / period_s) % 1.0, (time[end] / period_s) % 1.0))
    return found


def _belt_speed(trial: Trial) -> float:
    """The backward speed of the heel in stance: only a swinging heel moves forward."""
    heel = trial.markers.select(["R.Heel"]).positions[:, 0, 0]
    return float(-np.percentile(np.gradient(heel, trial.markers.time), 10))


def _write(path: Path, header: list[str], table: pd.DataFrame, form: str) -> None:
    path.write_text("\n".join(header) + "\n" + table.to_csv(float_format=form, lineterminator="\n"), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
