"""Shows the skeleton walking, in the report's own 3-D view and as a plotly figure."""

from typing import Any

import numpy as np

from kinertia.estimation.result import Fit
from kinertia.estimation.trial_fit import TrialFit
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.report import style
from kinertia.report.bsp_figures import segment_name
from kinertia.report.figure import Figure, compact
from kinertia.report.panels import base_layout, plain
from kinertia.report.scene import Scene, plate_corners
from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N

_PLOTLY_FRAMES = 60
"""Plotly redraws the whole scene for every frame."""
_ARROW_M_PER_N = 0.001
_BALL_M_PER_KG = 0.03
"""Radius of the ball that stands for one kilogram; it grows with the cube root of the mass."""


def scene(fit: Fit, trial: TrialFit, most_frames: int) -> Scene:
    """Assemble the view of a trial: the window, in at most `most_frames` frames."""
    chosen = slice(None, None, -(-len(trial.time) // most_frames))
    labels = trial.kinematics.ik.labels
    skeleton = trial.skeleton.with_markers([m for m in trial.skeleton.markers if m.label in labels])
    pose = skeleton.pose(trial.motion.q[chosen])
    bones, sides, points = _bones(skeleton, pose.rotation, pose.translation)
    frames = trial.kinematics.frames[chosen]
    measured = trial.kinematics.trial.markers.select(skeleton.labels).positions[frames]
    bodies = [skeleton.segments.index(name) for name in fit.estimate.segments]
    rotation, translation = pose.rotation[:, bodies], pose.translation[:, bodies]
    return Scene(
        time=trial.time[chosen],
        centre=points[:, 0],
        bones=bones,
        sides=sides,
        points=points,
        measured=measured,
        modelled=skeleton.marker_positions(pose),
        com=_centres(fit.estimate, rotation, translation),
        com_before=_centres(fit.literature, rotation, translation),
        com_sides=tuple(_side(name) for name in fit.estimate.segments),
        ellipsoids=semi_axes(fit.estimate) @ rotation.swapaxes(-1, -2),
        arrows=_arrows(trial.kinematics)[chosen],
        plates=plate_corners(trial.kinematics.trial.loads.corners),
    )


def _bones(
    skeleton: Skeleton, rotation: np.ndarray, translation: np.ndarray
) -> tuple[np.ndarray, tuple[str, ...], np.ndarray]:
    """Return a line to every joint centre from its parent's, across hips and shoulders, and to every last marker."""
    index = {name: i for i, name in enumerate(skeleton.segments)}
    bones = [(index[joint.parent], index[joint.child]) for joint in skeleton.joints if joint.parent in index]
    named = [joint.child for joint in skeleton.joints if joint.parent in index]
    parent = {joint.child: joint.parent for joint in skeleton.joints}
    for right in skeleton.segments:
        left = right[:-2] + "_l"
        if right.endswith("_r") and parent.get(left) == parent[right]:
            bones.append((index[right], index[left]))
            named.append(parent[right])
    points = [translation]
    for i, segment in enumerate(skeleton.segments):
        end = last_marker(skeleton, i)
        if end is None:
            continue
        points.append((rotation[:, i] @ end + translation[:, i])[:, None])
        bones.append((i, len(index) + len(points) - 2))
        named.append(segment)
    return np.array(bones), tuple(map(_side, named)), np.concatenate(points, axis=1)


def last_marker(skeleton: Skeleton, i: int) -> np.ndarray | None:
    """Return the last marker (3,) m of segment i, in its frame, if it is the trunk or a segment without children."""
    segment = skeleton.segments[i]
    worn = skeleton.marker_locals[skeleton.marker_segments == i]
    if not len(worn) or (segment != "torso" and any(joint.parent == segment for joint in skeleton.joints)):
        return None
    end: np.ndarray = worn[np.argmax(np.linalg.norm(worn, axis=1))]
    return end


def _side(segment: str) -> str:
    return segment[-1] if segment.endswith(("_r", "_l")) else ""


def _centres(bsp: BodySegmentParameters, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return centres of mass (n, s, 3) m of segments posed by rotation (n, s, 3, 3) and translation (n, s, 3)."""
    result: np.ndarray = (rotation @ bsp.com_m[:, :, None])[..., 0] + translation
    return result


def semi_axes(bsp: BodySegmentParameters) -> np.ndarray:
    """Return semi-axes (s, 3, 3) m (rows, segment axes) of uniform ellipsoids with each segment's mass and inertia.

    With principal moments I the square of a semi-axis is 5/(2 m) (I_j + I_k - I_i). NaN for a segment without mass, and
    for one whose inertia no body can have.
    """
    moments, axes = np.linalg.eigh(bsp.inertia_kgm2)
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = 2.5 / bsp.mass_kg[:, None] * (moments.sum(axis=1, keepdims=True) - 2 * moments)
        possible = (bsp.mass_kg > 0) & (squares > 0).all(axis=1)
        lengths = np.where(possible[:, None], np.sqrt(squares), np.nan)
    result: np.ndarray = lengths[:, :, None] * axes.swapaxes(1, 2)
    return result


def _arrows(kinematics: Kinematics) -> np.ndarray:
    """Return arrows (w, f, 2, 3) m from the centre of pressure along the force, 1 mm per newton."""
    force = kinematics.foot_loads[..., :3]
    loaded = force[..., 1:2] > LOAD_THRESHOLD_N
    at = np.where(loaded, centre_of_pressure(kinematics.foot_loads), np.nan)
    return np.stack([at, at + _ARROW_M_PER_N * force], axis=2)


def skeleton_figure(fit: Fit, trial: TrialFit) -> Figure:
    """Draw the view as a plotly figure for notebooks, with a slider and a play button; at most 60 frames."""
    shown = scene(fit, trial, _PLOTLY_FRAMES)
    steps = [
        {"label": f"{t:.2f}", "method": "animate", "args": [[str(k)], _at_once(0)]} for k, t in enumerate(shown.time)
    ]
    frame_ms = 1e3 * float(shown.time[-1] - shown.time[0]) / max(len(shown.time) - 1, 1)
    play = {"label": "play", "method": "animate", "args": [None, _at_once(frame_ms)]}
    pause = {"label": "pause", "method": "animate", "args": [[None], _at_once(0)]}
    layout = base_layout(f"The skeleton of {trial.name} in motion, with markers, centres of mass and ground reactions.")
    everything = [part.reshape(-1, 3) for part in (shown.points, shown.modelled)]
    low, high = np.nanmin(np.concatenate(everything), axis=0), np.nanmax(np.concatenate(everything), axis=0)
    axes: dict[str, dict[str, Any]] = {
        name: {"range": [float(low[k]) - 0.1, float(high[k]) + 0.1], "title": {"text": title}}
        for name, k, title in (("xaxis", 0, "forward (m)"), ("yaxis", 2, "right (m)"), ("zaxis", 1, "up (m)"))
    }
    axes["yaxis"]["range"] = axes["yaxis"]["range"][::-1]
    layout |= {
        "height": 560,
        "margin": {"t": 30, "b": 60, "l": 0, "r": 0},
        "scene": {**axes, "aspectmode": "data", "camera": {"eye": {"x": 0.5, "y": -2.7, "z": 0.3}}},
        "sliders": [{"steps": steps, "currentvalue": {"prefix": "time (s): "}, "pad": {"b": 40}}],
        "updatemenus": [{"type": "buttons", "buttons": [play, pause], "direction": "left", "y": 0, "yanchor": "top"}],
    }
    frames = [{"name": str(k), "data": _traces(shown, fit.estimate, k)} for k in range(len(shown.time))]
    return Figure(_traces(shown, fit.estimate, 0), layout, frames)


def _at_once(duration_ms: float) -> dict[str, Any]:
    return {"mode": "immediate", "frame": {"duration": duration_ms, "redraw": True}, "transition": {"duration": 0}}


def _traces(shown: Scene, bsp: BodySegmentParameters, k: int) -> list[dict[str, Any]]:
    """Convert the scene to traces; plotly's z is our up, its y our right."""
    lines = np.full((len(shown.bones), 3, 3), np.nan)
    lines[:, :2] = shown.points[k][shown.bones]
    sides = np.array(shown.sides)
    arrows = np.full((shown.arrows.shape[1], 3, 3), np.nan)
    arrows[:, :2] = shown.arrows[k]
    radius = 300 * _BALL_M_PER_KG * np.cbrt(np.maximum(bsp.mass_kg, 0.0))
    names = [f"{segment_name(name)}: {mass:.2f} kg" for name, mass in zip(bsp.segments, bsp.mass_kg, strict=True)]
    balls = {"size": radius.tolist(), "color": style.ORANGE, "opacity": 0.75, "line": {"width": 0}}
    return [
        *(
            _trace(lines[sides == side], word or "trunk", mode="lines", line={"color": colour, "width": 5})
            for side, (word, colour) in style.SIDES.items()
        ),
        _trace(arrows, "ground reaction", mode="lines", line={"color": style.GREEN, "width": 6}),
        _trace(shown.modelled[k], "markers, model", mode="markers", marker={"size": 3, "color": style.SKY}),
        _trace(shown.measured[k], "markers, measured", mode="markers", marker={"size": 3, "color": style.BLACK}),
        _trace(
            shown.com[k],
            "centres of mass",
            mode="markers",
            marker=balls,
            text=[plain(name) for name in names],
        ),
    ]


def _trace(points: np.ndarray, name: str, **settings: Any) -> dict[str, Any]:
    x, y, z = compact(points.reshape(-1, 3).T)
    return {"type": "scatter3d", "x": x, "y": z, "z": y, "name": name, **settings}
