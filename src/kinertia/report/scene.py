"""Assembles the content of every frame of a 3-D view, and encodes it for a page.

`templates/scene_view.js` plays it: a small drawing of lines, dots and ellipses needs no 3-D library and stays smooth.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup

from kinertia.report import style

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
    colours = {side: colour for side, (_, colour) in style.SIDES.items()}
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
    for _, one in scenes:
        parts |= one.parts()
    return {
        "names": [name for name, _ in scenes],
        "scenes": [Markup(json.dumps(packed(one)).replace("<", "\\u003c")) for _, one in scenes],  # nosec B704
        "parts": {name: words for name, words in PARTS.items() if name in parts},
    }
