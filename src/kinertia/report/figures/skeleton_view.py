"""Shows the skeleton walking: assembles the frames of a 3-D view, for the report and for plotly.

`templates/scene_view.js` plays it: a small drawing of lines, dots and ellipses needs no 3-D library and stays smooth.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.report.figures.bsp_figures import segment_name
from kinertia.report.figures.figure import BLACK, GREEN, ORANGE, SIDES, SKY, Figure, base_layout, compact, plain
from kinertia.trial.data import LOAD_THRESHOLD_N
from kinertia.trial.ground_contact import centre_of_pressure

_PLOTLY_FRAMES = 60
"""Plotly redraws the whole scene for every frame."""
_ARROW_M_PER_N = 0.001
_BALL_M_PER_KG = 0.03
"""Radius of the ball that stands for one kilogram; it grows with the cube root of the mass."""
PARTS = {
    "measured": "markers, measured",
    "labels": "names of the markers",
    "modelled": "markers, model",
    "arrows": "ground reactions",
    "plates": "force plates",
    "com": "centres of mass: ○ before, ● after",
    "ellipsoids": "ellipsoids of the estimated mass and inertia",
}
"""Parts of a view that can be switched on and off, in words."""
_HIDDEN_MM = -32768


def _nothing() -> np.ndarray:
    return np.empty(0)


@dataclass(frozen=True)
class Scene:
    """Points of a 3-D view in ground axes (m) over n frames; parts that a scene lacks are empty.

    Attributes:
        time: (n,) s.
        centre: (n, 3) point that the camera follows.
        bones: (b, 2) indices into `points` of the ends of every line.
        sides: (b,) "r", "l" or "" for every line.
        points: (n, p, 3) ends of the lines; NaN where unknown.
        measured, modelled: (n, m, 3) markers; NaN where not seen.
        labels: names of the measured markers.
        com, com_before: (n, s, 3) centres of mass, of segments with mass, and before the estimate.
        com_sides: (s,) "r", "l" or "".
        ellipsoids: (n, s, 3, 3) semi-axes as vectors, one per row, of ellipsoids about `com`; NaN where there is none.
        arrows: (n, f, 2, 3) centre of pressure and tip of the ground reaction under each foot; NaN without load.
        plates: (p, 4, 3) corners.
    """

    time: np.ndarray
    centre: np.ndarray
    bones: np.ndarray
    sides: tuple[str, ...]
    points: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray = field(default_factory=_nothing)
    labels: tuple[str, ...] = ()
    com: np.ndarray = field(default_factory=_nothing)
    com_before: np.ndarray = field(default_factory=_nothing)
    com_sides: tuple[str, ...] = ()
    ellipsoids: np.ndarray = field(default_factory=_nothing)
    arrows: np.ndarray = field(default_factory=_nothing)
    plates: np.ndarray = field(default_factory=_nothing)

    def parts(self) -> dict[str, str]:
        """Return the parts among `PARTS` that this scene has."""
        return {name: words for name, words in PARTS.items() if np.size(getattr(self, name))}


def plate_corners(corners: np.ndarray | None) -> np.ndarray:
    """Return `Scene.plates`; empty where the files do not state corners."""
    return np.empty((0, 4, 3)) if corners is None else corners


def packed(shown: Scene) -> dict[str, Any]:
    """Encode the scene for the page: whole millimetres from a point near the person, 16 bits each, base64."""
    place = np.round(shown.centre.mean(axis=0) * [1, 0, 1], 3)
    moving = {
        "centre": shown.centre[:, None],
        "points": shown.points,
        "measured": shown.measured,
        "modelled": shown.modelled,
        "com": shown.com,
        "com_before": shown.com_before,
        "arrows": shown.arrows,
    }
    parts = {name: values.reshape(len(shown.time), -1, 3) - place for name, values in moving.items() if values.size}
    parts["plates"] = shown.plates.reshape(1, -1, 3) - place
    parts["ellipsoids"] = shown.ellipsoids.reshape(len(shown.time), -1, 3)
    colours = {side: colour for side, (_, colour) in SIDES.items()}
    return {
        "time": [round(float(t), 4) for t in shown.time],
        "bones": shown.bones.tolist(),
        "colours": [colours[side] for side in shown.sides],
        "body_colours": [colours[side] for side in shown.com_sides],
        "labels": list(shown.labels),
        "count": {name: values.shape[1] for name, values in parts.items()},
        "data": {name: _millimetres(values) for name, values in parts.items()},
    }


def _millimetres(positions: np.ndarray) -> str:
    whole = np.where(np.isfinite(positions), np.clip(np.round(1e3 * positions), -32767, 32767), _HIDDEN_MM)
    return base64.b64encode(whole.astype("<i2").tobytes()).decode("ascii")


def view(scenes: Sequence[tuple[str, Scene]]) -> dict[str, Any]:
    """Arrange scenes with the names of their trials for the templates, in one view with a selector."""
    parts: dict[str, str] = {}
    for _, drawing in scenes:
        parts |= drawing.parts()
    return {
        "names": [name for name, _ in scenes],
        "scenes": [Markup(json.dumps(packed(drawing)).replace("<", "\\u003c")) for _, drawing in scenes],  # nosec B704
        "parts": {name: words for name, words in PARTS.items() if name in parts},
    }


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
    balls = {"size": radius.tolist(), "color": ORANGE, "opacity": 0.75, "line": {"width": 0}}
    return [
        *(
            _trace(lines[sides == side], word or "trunk", mode="lines", line={"color": colour, "width": 5})
            for side, (word, colour) in SIDES.items()
        ),
        _trace(arrows, "ground reaction", mode="lines", line={"color": GREEN, "width": 6}),
        _trace(shown.modelled[k], "markers, model", mode="markers", marker={"size": 3, "color": SKY}),
        _trace(shown.measured[k], "markers, measured", mode="markers", marker={"size": 3, "color": BLACK}),
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
