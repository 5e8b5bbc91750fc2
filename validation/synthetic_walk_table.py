"""Make the package's synthetic walk from measurements.

Makes the package's synthetic walk, `src/kinertia/synthetic/data/*.csv`, from the measured gait2354 walk.

The walk is a truncated Fourier series of every coordinate, fitted to the inverse kinematics of two treadmill strides
of OpenSim's gait2354 example; then, as in the study, the pelvis is modified until the motion asks for the measured
ground reactions (as a series of the same harmonics), so that the centre of pressure stays under the feet. The belt's
speed is added to the forward translation. The standing person is the model of the same subject, adapted to the walk,
in a standing pose.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.model.gait27 import build_gait27
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, residual, root_derivatives
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Recording, Trial
from kinertia.trial.plate_assignment import build_trial
from kinertia.trial.sampled_data import runs
from kinertia.workflow.built_in_model import calibrate
from validation.measured_data import data_folder

HARMONICS = 8
STANDING = {"elbow_flex_r": 1.2, "elbow_flex_l": 1.2, "arm_add_r": -0.25, "arm_add_l": -0.25}
PELVIS_SD_M, PELVIS_SD_RAD = 0.01, 0.02
FORCE_SD_N, MOMENT_SD_NM = 3.0, 1.0
DATA = Path(__file__).parents[1] / "src" / "kinertia" / "synthetic" / "data"


def basis(time: np.ndarray, period_s: float, order: int = 0) -> np.ndarray:
    """Return the Fourier basis (n, 1 + 2 h): constant, cosine and sine of every harmonic; or their time derivatives."""
    rate = 2 * np.pi / period_s * np.arange(1, HARMONICS + 1)
    angle = np.outer(time, rate) + order * np.pi / 2
    pairs = (np.stack([np.cos(angle), np.sin(angle)], axis=-1) * rate[:, None] ** order).reshape(len(time), -1)
    return np.column_stack([np.full(len(time), 1.0 if order == 0 else 0.0), pairs])


def main() -> None:
    """Fit and write both tables."""
    folder = data_folder() / "gait2354"
    static = read_recording(folder / "subject01_static.trc")
    walk = read_recording(folder / "subject01_walk1.trc", folder / "subject01_walk1_grf.mot")
    marker_set = read_marker_set("cleveland-clinic")
    present = {s: [m for m in labels if m in walk.markers.labels] for s, labels in marker_set.foot_labels().items()}
    trial = build_trial(walk, present)
    model = build_gait27(static, marker_set, 1.803, "male")
    skeleton = calibrate(model, [trial]).skeleton
    kinematics = solve_kinematics(skeleton, trial, 0.0, 8.0)
    write_standing(skeleton, static)
    write_walk(kinematics, trial)


def write_walk(kinematics: Kinematics, trial: Trial) -> None:
    """Write the Fourier series of the coordinates, with the head of the file."""
    time, q = kinematics.time, kinematics.motion.q

    def misfit(period_s: float) -> float:
        return float(np.square(q - basis(time, period_s) @ np.linalg.lstsq(basis(time, period_s), q)[0]).sum())

    period_s = float(minimize_scalar(misfit, bounds=(1.0, 1.5), method="bounded").x)
    coefficients = np.linalg.lstsq(basis(time, period_s), q)[0]
    rms = np.sqrt(np.mean(np.square(q - basis(time, period_s) @ coefficients), axis=0))
    wrench = np.linalg.lstsq(basis(time, period_s), kinematics.foot_loads.sum(axis=1))[0]
    coefficients, moved = balanced(coefficients, wrench, period_s)
    contacts = _contacts(trial.loads.time, trial.loads.force[:, :, 1], period_s)
    header = [
        "# Fitted by validation/synthetic_walk_table.py: joint coordinates of a walk (rad, m) as Fourier series",
        "# over one stride. At time t: mean, plus for every h cos_h cos(2 pi h t / period) and sin_h sin(2 pi h t /",
        "# period); pelvis_tx moves on at the walking speed. Of two treadmill strides of OpenSim's gait2354 example",
        "# (opensim-models, Pipelines/Gait2354_Simbody, subject01_walk1); RMS misfit "
        f"{np.degrees(rms[3:]).mean():.2f} deg, {rms[:3].max() * 1e3:.1f} mm; then the pelvis",
        f"# moved by RMS {moved[:3].max() * 1e3:.1f} mm, {np.degrees(moved[3:]).max():.2f} deg, so that it asks for "
        "the measured ground reactions.",
        f"# period_s = {period_s:.4f}",
        f"# speed_m_s = {_belt_speed(trial):.3f}",
        "# contact_r = {:.3f}, {:.3f}".format(*contacts[0]),
        "# contact_l = {:.3f}, {:.3f}".format(*contacts[1]),
    ]
    columns = ["mean"] + [f"{kind}_{h}" for h in range(1, HARMONICS + 1) for kind in ("cos", "sin")]
    table = pd.DataFrame(coefficients.T, index=pd.Index(kinematics.ik.coordinates, name="coordinate"), columns=columns)
    table.loc["pelvis_tx", "mean"] = table.loc["pelvis_tz", "mean"] = 0.0
    _write(DATA / "walk.csv", header, table, "%.7f")
    print("\n".join(header))


def balanced(coefficients: np.ndarray, wrench: np.ndarray, period_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Find coefficients whose pelvis balances the ground reactions, and (6,) how far it moved from the first ones (RMS;
    m, rad).

    Gauss-Newton on the root residual over one stride and on the change of the pelvis, each over its standard deviation.
    """
    subject = walking_subject()
    time = np.arange(128) * period_s / 128
    orders = [basis(time, period_s, order) for order in range(3)]
    load = orders[0] @ wrench
    start = coefficients.copy()
    current = coefficients.copy()
    pelvis = np.repeat([PELVIS_SD_M, PELVIS_SD_RAD], 3)
    residual_sd = np.repeat([FORCE_SD_N, MOMENT_SD_NM], 3)
    for _ in range(15):
        motion = Motion(*(order @ current for order in orders))
        left = residual(subject.skeleton, subject.bsp, motion, load) / residual_sd
        by = root_derivatives(subject.skeleton, subject.bsp, motion, load)
        jacobian = sum(
            np.einsum("nij,nk->nikj", part, order) for part, order in zip((by.q, by.qd, by.qdd), orders, strict=True)
        )
        jacobian = (jacobian / residual_sd[:, None, None]).reshape(-1, 6 * len(current))
        kept = np.einsum("nk,ij->nikj", orders[0], np.diag(1 / pelvis)).reshape(-1, 6 * len(current))
        change = orders[0] @ (current - start)[:, :6] / pelvis
        step = np.linalg.lstsq(np.vstack([jacobian, kept]), -np.concatenate([left.ravel(), change.ravel()]))[0]
        current[:, :6] += step.reshape(-1, 6)
    rms = np.sqrt(np.mean(np.square(left * residual_sd), axis=0))
    print("residual left, RMS (N, N m):", rms.round(2))
    return current, np.sqrt(np.mean(np.square(orders[0] @ (current - start)[:, :6]), axis=0))


def write_standing(skeleton: Skeleton, static: Recording) -> None:
    """Write the markers of the model in a standing pose."""
    stand = np.zeros(len(skeleton.coordinates))
    for name, value in STANDING.items():
        stand[skeleton.coordinates.index(name)] = value
    positions = skeleton.marker_positions(skeleton.pose(stand[None]))[0]
    feet = [i for i, m in enumerate(skeleton.markers) if m.segment.startswith("foot")]
    ankle = static.markers.positions[:, [static.markers.labels.index(skeleton.labels[i]) for i in feet], 1]
    positions[:, 1] += np.median(ankle) - np.median(positions[feet, 1])
    header = [
        "# Made by validation/synthetic_walk_table.py: markers (m; X forward, Y up, Z right) of the synthetic walker",
        "# standing, the gait2354 subject (72.6 kg, 1.803 m).",
    ]
    table = pd.DataFrame(positions, index=pd.Index(skeleton.labels, name="label"), columns=["x", "y", "z"])
    _write(DATA / "standing.csv", header, table, "%.5f")


def _contacts(time: np.ndarray, vertical: np.ndarray, period_s: float) -> list[tuple[float, float]]:
    """Return start and end of contact of each foot, in shares of the stride."""
    spans = []
    for foot in range(2):
        whole = [(a, b) for a, b in runs(vertical[:, foot] > 20.0) if a > 0 and b < len(time) - 1]
        start, end = whole[0]
        spans.append(((time[start] / period_s) % 1.0, (time[end] / period_s) % 1.0))
    return spans


def _belt_speed(trial: Trial) -> float:
    """Return the backward speed of the heel in stance: only a swinging heel moves forward."""
    heel = trial.markers.select(["R.Heel"]).positions[:, 0, 0]
    return float(-np.percentile(np.gradient(heel, trial.markers.time), 10))


def _write(path: Path, header: list[str], table: pd.DataFrame, form: str) -> None:
    path.write_text("\n".join(header) + "\n" + table.to_csv(float_format=form, lineterminator="\n"), encoding="utf-8")
