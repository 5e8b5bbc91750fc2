"""Moments of Plug-in Gait and Kinertia's, frame by frame over the stance, and where their differences come from.

Kinertia's are those of its C3D files (`outputs_of`). They are computed again about Vicon's joint centres in Vicon's
axes, and so with the forces as they were measured: what remains is due to segment parameters and smoothing.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from kinertia.estimation.result import Fit
from kinertia.estimation.trial_fit import TrialFit
from kinertia.motion.ground_reactions import measured_reactions
from kinertia.motion.joint_moments import component_signs
from kinertia.motion.joint_wrench import joint_wrenches, leg_joints
from kinertia.report.exports.c3d_results import outputs_of
from kinertia.report.pages.file_outputs import moment_divisor
from kinertia.report.wording import INTERVAL_SD
from kinertia.trial.data import FEET
from kinertia.trial.sampled_time import nearest_samples
from validation.vicon_axes import ViconPoints

COMPONENTS = ("flexion", "adduction", "rotation")
_LOADED_N = 20.0
_RIGHT_FORWARD_UP = [2, 0, 1]
_NM = 1e-3
OURS = ("ours", "vicon_axes", "as_measured")
"""Kinertia's moments: as they are, about Vicon's centres in its axes, and so with the forces as measured."""


def curves(recording: str, fit: Fit, folder: Path) -> Iterator[pd.DataFrame]:
    """Yield a table per trial: rows are frames of a joint's component in stance on plates, N m/kg with Vicon's signs.

    Columns: `recording`, `trial`, `joint`, `side`, `component`, `inside` (all ground contact is on plates), `vicon`,
    those of OURS, and `sd`; ours are NaN in frames in which the leg's load is not known.

    Args:
        recording: name.
        fit: the fit.
        folder: of the files.
    """
    for trial in fit.trials:
        if trial.kinematics.trial.outputs is not None and trial.joint_curves is not None:
            path = next(folder.rglob(f"{trial.name}.c3d"))
            yield _of_trial(fit, trial, ViconPoints.read(path, trial.kinematics.trial)).assign(recording=recording)


def _of_trial(fit: Fit, trial: TrialFit, points: ViconPoints) -> pd.DataFrame:
    curve, stated = trial.joint_curves, trial.kinematics.trial.outputs
    assert curve is not None
    assert stated is not None
    time, measured = curve.time, measured_reactions(trial.kinematics)
    force_n = measured.at(time)[:, :, 1]
    inside = np.isin(np.round(time, 6), np.round(trial.time, 6))
    other = _in_vicons_axes(fit, trial, points)
    tables = []
    for one in outputs_of(fit, trial, "plug-in-gait"):
        if one.kind == "MOMENTS" and one.name in stated.values:
            stance = force_n[:, FEET.index(one.side)] > _LOADED_N
            theirs = stated.values[one.name] / moment_divisor(stated, one.kind, fit.mass_kg)
            theirs = theirs[nearest_samples(stated.time, time)]
            for row, component in enumerate(COMPONENTS):
                values = {"vicon": theirs[:, row], "ours": _NM * one.values[:, row], "sd": _NM * one.sd[:, row]}
                values |= {kind: other[kind][one.joint, one.side][:, row] for kind in OURS[1:]}
                table = pd.DataFrame({"inside": inside, **values})[stance].dropna(subset="vicon")
                key = {"trial": trial.name, "joint": one.joint.lower(), "side": one.side, "component": component}
                tables.append(table.assign(**key))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _in_vicons_axes(fit: Fit, trial: TrialFit, points: ViconPoints) -> dict[str, dict[tuple[str, str], np.ndarray]]:
    """Return moments (f, 3) N m/kg by joint and side: with corrected forces and with those measured."""
    curve, frames = trial.joint_curves, trial.kinematics.course_frames
    assert curve is not None
    shown, pose = points.at(frames), trial.skeleton.pose(curve.motion.q)
    result: dict[str, dict[tuple[str, str], np.ndarray]] = {}
    for kind, reactions in zip(OURS[1:], (trial.reactions, measured_reactions(trial.kinematics)), strict=True):
        wrenches = joint_wrenches(trial.skeleton, fit.estimate, curve.motion, reactions.at(curve.time))
        result[kind] = {}
        for joint, wrench in wrenches.items():
            ours = pose.rotation[:, trial.skeleton.segments.index(joint.child)]
            centre, axes = shown.centre(joint), shown.axes(joint, ours)
            if centre is None or axes is None:
                result[kind][joint.name, joint.side] = np.full((len(ours), 3), np.nan)
                continue
            moment = wrench[:, 3:] + np.cross(joint.centre(trial.skeleton, pose) - centre, wrench[:, :3])
            along = np.einsum("nka,nk->na", axes[:, :, _RIGHT_FORWARD_UP], moment)
            result[kind][joint.name, joint.side] = -component_signs(joint) * along / fit.mass_kg
    return result


def agreement(rows: pd.DataFrame) -> dict[str, float]:
    """Return what the page says of some frames of a component: N m/kg, correlation and shares."""
    both = rows.dropna(subset="ours")
    off = both["ours"] - both["vicon"]

    def rms(values: pd.Series) -> float:
        return float(np.sqrt(np.square(values).mean()))

    return {
        "frames": float(len(both)),
        "known": len(both) / len(rows),
        "correlation": float(np.corrcoef(both["ours"], both["vicon"])[0, 1]),
        "vicon": rms(both["vicon"]),
        "rms": rms(off),
        "mean": float(off.mean()),
        "sd": rms(both["sd"]),
        "covered": float((off.abs() < INTERVAL_SD * both["sd"]).mean()),
        "vicon_axes": rms(both["vicon_axes"] - both["vicon"]),
        "as_measured": rms(both["as_measured"] - both["vicon"]),
    }


def centres_apart_m(fit: Fit, folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Yield per joint of each trial how far (3,) m its centre is forward, up and outward of Vicon's, on average.

    Axes are those of the segment above the joint.
    """
    for trial in fit.trials:
        curve = trial.joint_curves
        if curve is None or trial.kinematics.trial.outputs is None:
            continue
        points = ViconPoints.read(next(folder.rglob(f"{trial.name}.c3d")), trial.kinematics.trial)
        points, pose = points.at(trial.kinematics.course_frames), trial.skeleton.pose(curve.motion.q)
        for joint in leg_joints(trial.skeleton):
            centre = points.centre(joint)
            if centre is not None:
                axes = pose.rotation[:, trial.skeleton.segments.index(joint.parent)]
                apart = np.einsum("nka,nk->na", axes, joint.centre(trial.skeleton, pose) - centre)
                outward = [1.0, 1.0, 1.0 if joint.side == "r" else -1.0]
                yield joint.name.lower(), np.nanmean(apart, axis=0) * outward
