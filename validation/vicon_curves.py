"""Moments of Plug-in Gait and Kinertia's, frame by frame over the stance, and where their differences come from.

They are those of `moment_differences`: what remains with Vicon's centres, axes and forces is due to segment parameters
and smoothing.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from kinertia.estimation.result.fit import Fit
from kinertia.motion.joint_moments import leg_joints
from kinertia.report.pages.vicon_differences import ViconPoints, moment_differences
from kinertia.report.wording import INTERVAL_SD

_OTHERS = {"vicon_axes": "centre and axes", "as_measured": "all"}
"""Kinertia's moments about Vicon's centres in its axes, and so with the forces as measured: names there."""


def curves(recording: str, fit: Fit) -> Iterator[pd.DataFrame]:
    """Yield a table per curve: rows are frames of a joint's component in stance on plates, N m/kg with Vicon's signs.

    Columns: `recording`, `trial`, `joint`, `side`, `component`, `inside` (all ground contact is on plates), `vicon`,
    `ours`, `sd`, `vicon_axes` (about Vicon's centres in its axes) and `as_measured` (with the forces as measured, too);
    ours are NaN in frames in which the leg's load is not known.

    Args:
        recording: name.
        fit: the fit.
    """
    for trial in fit.trials:
        for moment_difference in moment_differences(fit, trial):
            values = {name: getattr(moment_difference, name) for name in ("inside", "vicon", "ours", "sd")}
            values |= {name: moment_difference.others[kind] for name, kind in _OTHERS.items()}
            key = {
                "trial": moment_difference.trial,
                "joint": moment_difference.joint.lower(),
                "side": moment_difference.side,
                "component": moment_difference.component,
            }
            yield pd.DataFrame(values).assign(recording=recording, **key)


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


def centres_apart_m(fit: Fit) -> Iterator[tuple[str, np.ndarray]]:
    """Yield per joint of each trial how far (3,) m its centre is forward, up and outward of Vicon's, on average.

    Axes are those of the segment above the joint.
    """
    for trial in fit.trials:
        curve, stated = trial.joint_curves, trial.kinematics.trial.outputs
        if curve is None or stated is None:
            continue
        points, pose = ViconPoints.at(stated, curve.time), trial.skeleton.pose(curve.motion.q)
        for joint in leg_joints(trial.skeleton):
            centre = points.centre(joint)
            if centre is not None:
                axes = pose.rotation[:, trial.skeleton.segments.index(joint.parent)]
                apart = np.einsum("nka,nk->na", axes, joint.centre(trial.skeleton, pose) - centre)
                outward = [1.0, 1.0, 1.0 if joint.side == "r" else -1.0]
                yield joint.name.lower(), np.nanmean(apart, axis=0) * outward
