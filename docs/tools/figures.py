"""Draw the figures of the pages from the package's own synthetic walker, and the README's from a measured walk.

    python docs/tools/figures.py [GAIT2354]

The timeline of measured frames has the times of OpenSim's Rajagopal walk. GAIT2354 is a folder with OpenSim's example
of that name and its scaled model (`subject01_scaled.osim`). Without it the README's figure stays as it is. That figure
needs OpenSim, and the repository on PYTHONPATH.
"""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from kinertia.model.skeleton import Pose
from kinertia.report.figures.measures_picture import measures_picture
from kinertia.synthetic.walk import SyntheticTrial, centre_of_pressure, walk, walking_subject

FOLDER = Path(__file__).resolve().parents[1] / "figures"
# Okabe and Ito: told apart by everybody
X, Y, Z, GREY, FORCE, RESIDUAL = "#D55E00", "#009E73", "#0072B2", "#777777", "#0072B2", "#D55E00"
SIDE, FRONT = (0, 1), (2, 1)
"""The two ground axes that a view shows."""
_FRAME_M = 0.13
_MASS_KG = 72.6
_USE_COLORS = {
    "use": ("#E8F5EE", "#009E73"),
    "use with care": ("#FFF6DB", "#E0A800"),
    "do not use": ("#FBE9E2", "#D55E00"),
}


def main() -> None:
    """Write all figures."""
    mpl.rcParams.update({"svg.hashsalt": "kinertia", "font.size": 11, "font.family": "sans-serif"})
    trial = walk(walking_subject())
    for name, draw in (("frames", frames), ("residual", residual), ("window", window)):
        figure = draw(trial)
        figure.savefig(FOLDER / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight")
        plt.close(figure)
    (FOLDER / "measures.svg").write_text(measures_picture(), encoding="utf-8", newline="\n")
    if len(sys.argv) > 1:
        with TemporaryDirectory() as work:
            figure = knee_moment(Path(sys.argv[1]).resolve(), Path(work))
        figure.savefig(FOLDER / "moments.svg", metadata={"Date": None})
        plt.close(figure)


def frames(trial: SyntheticTrial) -> plt.Figure:
    """Ground axes and segment frames, from the side and from the front."""
    figure, views = plt.subplots(1, 2, figsize=(6.4, 5.6), sharey=True, gridspec_kw={"width_ratios": [1, 1]})
    q = np.zeros((1, len(trial.skeleton.coordinates)))
    q[0, 1] -= trial.skeleton.marker_positions(trial.skeleton.pose(q))[..., 1].min() - 0.03
    pose = trial.skeleton.pose(q)
    for axes, view, title in zip(views, (SIDE, FRONT), ("from the right", "from behind"), strict=True):
        _bones(axes, trial, pose, 0, view)
        for k, segment in enumerate(trial.skeleton.segments):
            if segment.startswith("talus"):
                continue
            place = _place(trial, pose, 0, k)
            _triad(axes, place[:3, 3], place[:3, :3], view, _FRAME_M)
        _triad(axes, np.array([-0.35, 0.0, -0.55]), np.eye(3), view, 0.28, named=True)
        axes.set_title(title)
        axes.axhline(0.0, color="#bbbbbb", linewidth=1.0, zorder=0)
        _plain(axes)
    raised = {"forearm_r": 0.09, "torso": 0.06, "pelvis": -0.01, "thigh_r": -0.03}
    for segment in ("pelvis", "torso", "thigh_r", "shank_r", "foot_r", "upper_arm_r", "forearm_r"):
        at = _place(trial, pose, 0, trial.skeleton.segments.index(segment))[:3, 3]
        line = {"arrowstyle": "-", "color": "#cccccc", "linewidth": 0.7}
        where = (0.52, at[1] + raised.get(segment, 0.0))
        views[1].annotate(segment, (at[2], at[1]), where, va="center", color="#333333", arrowprops=line)
    views[0].text(-0.35, -0.12, "ground axes: X forward, Y up, Z right", color="#333333")
    return figure


def residual(trial: SyntheticTrial) -> plt.Figure:
    """One frame with ground reactions, weight and the residual."""
    figure, axes = plt.subplots(figsize=(5.6, 4.2))
    frame = int(np.argmin(np.abs(trial.foot_loads[:, 0, 1] - trial.foot_loads[:, 1, 1])))
    pose = trial.skeleton.pose(trial.motion.q)
    _bones(axes, trial, pose, frame, SIDE)
    for foot, name in enumerate(("right", "left")):
        load = trial.foot_loads[frame, foot]
        at = centre_of_pressure(load[None])[0]
        _arrow(axes, at[:2], load[:2] / 900.0, FORCE)
        outward = 0.03 if at[0] > trial.motion.q[frame, 0] else -0.03
        axes.text(at[0] + outward, -0.04, f"measured under\nthe {name} foot", color=FORCE, va="top",
                  ha="left" if outward > 0 else "right")  # fmt: skip
    pelvis = _place(trial, pose, frame, trial.skeleton.segments.index("pelvis"))[:3, 3]
    _arrow(axes, pelvis[:2], np.array([0.28, 0.12]), RESIDUAL)
    axes.text(pelvis[0] + 0.31, pelvis[1] + 0.13, "residual P = what the motion needs\n- what the plates measured:\n"
              "force at, and moment about,\nthe pelvis origin, ground axes", color=RESIDUAL, va="center")  # fmt: skip
    axes.axhline(0.0, color="#bbbbbb", linewidth=1.0, zorder=0)
    axes.set_xlim(pelvis[0] - 0.6, pelvis[0] + 1.25)
    axes.set_ylim(-0.25, 1.85)
    _plain(axes)
    return figure


def window(trial: SyntheticTrial) -> plt.Figure:
    """Which frames count: ground contact, contact on a plate, and what is left."""
    figure, axes = plt.subplots(figsize=(6.2, 2.3))
    ground = {"right foot": [(0.268, 1.023), (1.412, 2.167)], "left foot": [(0.0, 0.47), (0.836, 1.589), (1.96, 2.37)]}
    plate = {"right foot": [(0.268, 1.023), (1.412, 2.167)], "left foot": [(0.836, 1.589)]}
    for row, name in enumerate(("right foot", "left foot")):
        for start, end in ground[name]:
            axes.broken_barh([(start, end - start)], (1.1 - row, 0.7), facecolor="white", edgecolor=GREY, hatch="////")
        for start, end in plate[name]:
            axes.broken_barh([(start, end - start)], (1.1 - row, 0.7), facecolor=FORCE, edgecolor=FORCE)
            axes.text((start + end) / 2, 1.45 - row, "on a plate", color="white", ha="center", va="center")
    axes.text(
        0.235, 0.45, "missed", ha="center", va="center", bbox={"facecolor": "white", "edgecolor": "none", "pad": 1}
    )
    axes.text(
        2.165, 0.45, "missed", ha="center", va="center", bbox={"facecolor": "white", "edgecolor": "none", "pad": 1}
    )
    axes.axvspan(0.48, 1.95, color=Y, alpha=0.18, zorder=0)
    axes.text(1.215, 2.0, "frames that count", color=Y, ha="center", va="bottom")
    axes.set_yticks([1.45, 0.45], ["right foot", "left foot"])
    axes.set_xlim(0.0, 2.37)
    axes.set_ylim(0.0, 2.3)
    axes.set_xlabel("time (s)")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(left=False)
    return figure


def knee_moment(data: Path, work: Path) -> plt.Figure:
    """A knee moment of the gait2354 walk with its 95 % band, OpenSim's over it, and what the fit says of the plates."""
    out = work / "fit"
    walk = [data / "subject01_walk1.trc", "--forces", data / "subject01_walk1_grf.mot"]
    walk += ["--loads", data / "subject01_walk1_grf.xml", "--model", data / "subject01_scaled.osim"]
    subprocess.run(["kinertia", "fit", *walk, "--calibrate", f"--mass={_MASS_KG}", "-o", out, "--quiet"], check=True)
    curves = pd.read_csv(out / "cycles.csv").query("side == 'r' and stride == 1 and quantity == 'knee_angle_moment'")
    stride = pd.read_csv(out / "spatiotemporal.csv").query("side == 'r' and stride == 1").iloc[0]
    percent, ours, band = (curves[name].to_numpy() for name in ("percent", "value", "sd"))
    time = stride["start_s"] + percent / 100 * stride["stride_time_s"]
    theirs = _opensim_moments(data, work)["knee_angle_r_moment"]

    figure = plt.figure(figsize=(7.6, 4.1), facecolor="white")
    axes = figure.add_axes((0.09, 0.285, 0.88, 0.6))
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.8, zorder=0)
    interval = axes.fill_between(percent, ours - 1.96 * band, ours + 1.96 * band, color=FORCE, alpha=0.22, linewidth=0)
    (line,) = axes.plot(percent, ours, color=FORCE, linewidth=2.2)
    (other,) = axes.plot(
        percent, np.interp(time, theirs.index, theirs) / _MASS_KG, color="#222222", linewidth=1.5, linestyle=(0, (5, 2))
    )
    axes.axvline(stride["stance_percent"], ymax=0.62, color=GREY, linewidth=0.8, linestyle=":")
    axes.text(stride["stance_percent"] + 1, axes.get_ylim()[0], "toe off", color=GREY, va="bottom", fontsize=9.5)
    axes.set(xlim=(0, 100), xlabel="gait cycle (%)", ylabel="knee extension moment (N m/kg)")
    axes.yaxis.label.set_size(10)
    axes.xaxis.label.set_size(10)
    axes.tick_params(labelsize=9.5, color=GREY)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["bottom", "left"]].set_color(GREY)
    names = ["Kinertia", "its 95 % interval", "OpenSim inverse dynamics"]
    axes.legend([line, interval, other], names, frameon=False, fontsize=10, loc="upper right")
    figure.text(0.09, 0.935, "Right knee, measured walk (OpenSim's gait2354 example)", fontsize=12, weight="bold")
    _verdict_strip(figure, json.loads((out / "fit.json").read_text(encoding="utf-8")))
    return figure


def _opensim_moments(data: Path, work: Path) -> pd.DataFrame:
    """OpenSim's IK and ID with its scaled model: coordinates at 6 Hz, forces as measured."""
    import opensim

    from validation.opensim_runs import inverse_dynamics, inverse_kinematics, quietly, setup_weights, without_forces

    with quietly(work / "opensim.log"):
        model = opensim.Model(str(data / "subject01_scaled.osim"))
        weights = setup_weights(data / "subject01_Setup_IK.xml")
        inverse_kinematics(model, data / "subject01_walk1.trc", work / "ik.mot", weights)
        without_forces(data / "subject01_scaled.osim", work / "model.osim")
        loads = data / "subject01_walk1_grf.xml"
        return inverse_dynamics(work / "model.osim", work / "ik.mot", loads, work / "moments.sto", 6.0)


def _verdict_strip(figure: plt.Figure, fitted: dict) -> None:
    """What the fit says of its joint moments, and its finding about the left plate, below the curves."""
    use = next(rating["use"] for rating in fitted["suitability"] if rating["output"] == "joint moments")
    message = next(finding["message"] for finding in fitted["findings"] if finding["code"] == "P267")
    fill, edge = _USE_COLORS[use]
    strip = figure.add_axes((0.015, 0.03, 0.97, 0.125))
    strip.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[], facecolor=fill)
    strip.spines[:].set_visible(False)
    strip.axvspan(0, 0.008, color=edge, linewidth=0)
    strip.text(0.025, 0.7, f"Joint moments: {use}.", va="center", fontsize=10.5, weight="bold")
    strip.text(0.025, 0.28, message, va="center", fontsize=10.5)


def _place(trial: SyntheticTrial, pose: Pose, frame: int, segment: int) -> np.ndarray:
    """(4, 4) placement of a segment in ground."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = pose.rotation[frame, segment], pose.translation[frame, segment]
    return place


def _bones(axes: Axes, trial: SyntheticTrial, pose: Pose, frame: int, view: tuple[int, int]) -> None:
    """Lines from every segment's origin to its parent's, and the markers."""
    segments = trial.skeleton.segments
    at = np.array([_place(trial, pose, frame, k)[:3, 3] for k in range(len(segments))])
    for joint in trial.skeleton.joints:
        if joint.parent != "ground":
            ends = at[[segments.index(joint.parent), segments.index(joint.child)]]
            axes.plot(
                ends[:, view[0]], ends[:, view[1]], color="#999999", linewidth=3, solid_capstyle="round", zorder=1
            )
    markers = trial.skeleton.marker_positions(pose)[frame]
    for side in "rl":
        foot = segments.index(f"foot_{side}")
        ends = np.vstack([at[foot], markers[trial.skeleton.marker_segments == foot]])
        toe = int(np.argmax((ends - ends[0]) @ pose.rotation[frame, foot, :, 0]))
        axes.plot(ends[[0, toe], view[0]], ends[[0, toe], view[1]], color="#999999", linewidth=3, zorder=1)
    axes.plot(markers[:, view[0]], markers[:, view[1]], ".", color="#bbbbbb", markersize=4, zorder=2)


def _triad(
    axes: Axes, at: np.ndarray, rotation: np.ndarray, view: tuple[int, int], size: float, named: bool = False
) -> None:
    for k, (color, name) in enumerate(zip((X, Y, Z), "XYZ", strict=True)):
        step = size * rotation[list(view), k]
        if np.linalg.norm(step) > 0.3 * size:
            _arrow(axes, at[list(view)], step, color)
            if named:
                axes.text(*(at[list(view)] + 1.15 * step), name, color=color, ha="center", va="center", weight="bold")
        else:
            axes.plot(*at[list(view)], "o", color=color, markersize=4, zorder=4)


def _arrow(axes: Axes, at: np.ndarray, step: np.ndarray, color: str) -> None:
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", at + step, at, arrowprops=style, zorder=3)


def _plain(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.axis("off")


if __name__ == "__main__":
    main()
