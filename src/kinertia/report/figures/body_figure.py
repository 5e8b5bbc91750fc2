"""Draws the body from front and sides, coloured by changes or by how well the data inform each segment.

A segment is drawn as a capsule of its length, with the volume of water that has its mass before the estimate. It is a
sketch to identify segments, not a measurement of the person's shape.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.spatial import ConvexHull

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.report.figures.bsp_figures import segment_name
from kinertia.report.figures.figure import (
    BLACK,
    BLUE,
    GREY,
    UNUSED,
    VERMILION,
    Figure,
    base_layout,
    between,
    compact,
    plain,
)
from kinertia.report.figures.skeleton_view import last_marker
from kinertia.report.wording import INTERVAL_SD, fixed, start_of

Shown = Literal["mass", "information"]
"""Quantity that colours the segments."""

_DENSITY_KG_M3 = 1000.0
_CORNERS = 24
"""Corners of the circles around the ends of a segment."""
_APART_M = 0.18
_HEIGHT_PX, _TOP_PX, _BOTTOM_PX = 500, 56, 70
_LEAST_PERCENT = 10.0
"""The colours reach at least to this change of mass: smaller ones are pale."""


@dataclass(frozen=True)
class _View:
    """One of the drawings of the body.

    Attributes:
        title: heading above it.
        across: ground axis drawn from left to right.
        sign: -1 where that axis is drawn to the left.
        near: suffix of the limbs that are visible; "" for both sides.
    """

    title: str
    across: int
    sign: float
    near: str


_VIEWS = (
    _View("right side", 0, 1.0, "_r"),
    _View("front", 2, -1.0, ""),
    _View("left side", 0, -1.0, "_l"),
)


def body_figure(fit: Fit, shown: Shown = "mass") -> Figure | None:
    """Draw segments coloured by change of mass, or by information; None for the latter after two-level."""
    if shown == "mass":
        colours = _by_mass(fit)
    elif fit.posterior is not None:
        colours = _by_information(fit, fit.posterior)
    else:
        return None
    body = _standing(fit)
    data: list[dict[str, Any]] = []
    titles: list[dict[str, Any]] = []
    left = 0.0
    for view in _VIEWS:
        rows = sorted(body.seen(view), key=lambda i: body.segments[i].endswith(view.near))
        outlines = [_outline(body.points[i], body.radii[i], view) for i in rows]
        corners = np.concatenate(outlines)
        place = left - float(corners[:, 0].min())
        data += [
            _segment(outline + np.array([place, 0.0]), colours.fill(i), plain(colours.texts[i]))
            for i, outline in zip(rows, outlines, strict=True)
        ]
        data += _centres(fit, body, view, rows, place)
        right = place + float(corners[:, 0].max())
        titles.append(_title(view.title, 0.5 * (left + right), body.top))
        left = right + _APART_M
    data.append(colours.scale())
    hidden = {"visible": False, "fixedrange": True, "constrain": "domain"}
    layout = base_layout(colours.alt) | {
        "height": _HEIGHT_PX,
        "margin": {"t": _TOP_PX, "b": _BOTTOM_PX, "l": 4, "r": 4},
        "xaxis": {**hidden, "range": [-0.04, left - _APART_M + 0.04]},
        "yaxis": {**hidden, "scaleanchor": "x", "scaleratio": 1},
        "annotations": titles,
    }
    return Figure(data, layout)


@dataclass(frozen=True)
class _Body:
    """Segments with mass, with all coordinates of the model at their start, ground axes, m.

    Attributes:
        segments: names of the segments.
        points: per segment (p, 3) its extent: its joints, or its joint and its last marker; for an attached item
            its centre of mass.
        radii: radius per segment.
        before, after: (s, 3) centres of mass.
    """

    segments: tuple[str, ...]
    points: tuple[np.ndarray, ...]
    radii: tuple[float, ...]
    before: np.ndarray
    after: np.ndarray

    def seen(self, view: _View) -> list[int]:
        """Return rows of the visible segments that have mass; from one side without the limbs of the other side."""
        hidden = {"_r": "_l", "_l": "_r"}.get(view.near)
        shown = [i for i, radius in enumerate(self.radii) if radius > 0.0]
        return [i for i in shown if hidden is None or not self.segments[i].endswith(hidden)]

    @property
    def top(self) -> float:
        """Height of the highest outline, m."""
        return max(float(points[:, 1].max()) + radius for points, radius in zip(self.points, self.radii, strict=True))


def _standing(fit: Fit) -> _Body:
    skeleton, segments = fit.skeleton, fit.literature.segments
    rows = [skeleton.segments.index(name) for name in segments]
    pose = skeleton.pose(np.array([[skeleton.start.get(name, 0.0) for name in skeleton.coordinates]]))
    rotation, origin = pose.rotation[0], pose.translation[0]
    com_m = dict(zip(rows, fit.literature.com_m, strict=True))
    points = []
    for i in rows:
        marker = last_marker(skeleton, i)
        if marker is None:
            joints = [skeleton.segments.index(j.child) for j in skeleton.joints if j.parent == skeleton.segments[i]]
            at = origin[[i, *joints]] if joints else origin[i] + rotation[i] @ com_m[i] + np.zeros((1, 3))
            points.append(at)
        else:  # the trunk's may be in front of it or on one side
            end = marker if skeleton.segments[i].endswith(("_r", "_l")) else marker * [0.0, 1.0, 0.0]
            points.append(np.array([origin[i], origin[i] + rotation[i] @ end]))
    volumes = np.maximum(fit.literature.mass_kg, 0.0) / _DENSITY_KG_M3
    radii = [_radius(volume, _length(ends)) for volume, ends in zip(volumes, points, strict=True)]
    before, after = (
        (rotation[rows] @ bsp.com_m[:, :, None])[..., 0] + origin[rows] for bsp in (fit.literature, fit.estimate)
    )
    return _Body(segments, tuple(points), tuple(radii), before, after)


def _length(points: np.ndarray) -> float:
    """Return the distance between the two points farthest apart."""
    return float(np.linalg.norm(points[:, None] - points[None], axis=-1).max())


def _radius(volume_m3: float, length_m: float) -> float:
    """Return the radius (m) of a capsule: a cylinder of this length with a hemisphere on either end."""
    roots = np.roots([4 / 3 * math.pi, math.pi * length_m, 0.0, -volume_m3])
    return float(max(root.real for root in roots if abs(root.imag) < 1e-9))


def _flat(points: np.ndarray, view: _View) -> np.ndarray:
    """Project points to (..., 2) as drawn: across and up."""
    return np.stack([view.sign * points[..., view.across], points[..., 1]], axis=-1)


def _outline(points: np.ndarray, radius: float, view: _View) -> np.ndarray:
    """Return the closed outline (c, 2) around circles at the ends."""
    turn = np.linspace(0, 2 * np.pi, _CORNERS, endpoint=False)
    circle = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = (_flat(points, view)[:, None] + circle).reshape(-1, 2)
    around = ConvexHull(corners).vertices
    return corners[[*around, around[0]]]


def _segment(outline: np.ndarray, colour: str, text: str) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": compact(outline[:, 0]),
        "y": compact(outline[:, 1]),
        "fill": "toself",
        "fillcolor": colour,
        "line": {"color": GREY, "width": 1},
        "hoveron": "fills",
        "hoverinfo": "text",
        "text": text,
        "showlegend": False,
    }


def _centres(fit: Fit, body: _Body, view: _View, rows: list[int], place: float) -> list[dict[str, Any]]:
    """Draw centres of mass before and after the estimate."""
    texts = [_moved(fit, i) for i in rows]
    marks = ((f"CoM, {start_of(fit).word}", body.before, "circle-open"), ("CoM, estimate", body.after, "circle"))
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "x": compact(_flat(at[rows], view)[:, 0] + place),
            "y": compact(at[rows, 1]),
            "marker": {"symbol": symbol, "size": 7 if symbol == "circle-open" else 5, "color": BLACK},
            "name": name,
            "legendgroup": name,
            "showlegend": view is _VIEWS[0],
            "text": texts,
            "hoverinfo": "text",
        }
        for name, at, symbol in marks
    ]


def _moved(fit: Fit, i: int) -> str:
    forward, up, right = (fixed(1e3 * v, 1, sign=True) for v in fit.estimate.com_m[i] - fit.literature.com_m[i])
    name = plain(segment_name(fit.literature.segments[i]))
    return f"CoM of {name}: {forward} mm forward, {up} mm upward, {right} mm to the right"


def _title(text: str, x: float, y: float) -> dict[str, Any]:
    return {"text": f"<b>{text}</b>", "x": x, "y": y, "yanchor": "bottom", "showarrow": False, "font": {"size": 12}}


@dataclass(frozen=True)
class _Colours:
    """Colours of the segments, and what they represent.

    Attributes:
        values: (s,) a number per segment; NaN where it was fixed.
        limits: range of the colour scale.
        stops: colours at the lower limit, in the middle and at the upper one.
        title: title of the scale.
        texts: (s,) a sentence on each segment.
        alt: text alternative of the figure.
    """

    values: np.ndarray
    limits: tuple[float, float]
    stops: tuple[str, str, str]
    title: str
    texts: list[str]
    alt: str

    def fill(self, i: int) -> str:
        """Return the colour of segment i."""
        if not np.isfinite(self.values[i]):
            return UNUSED
        low, high = self.limits
        place = 2 * float(np.clip((self.values[i] - low) / (high - low), 0.0, 1.0))
        return between(self.stops[int(place > 1)], self.stops[1 + int(place > 1)], place - int(place > 1))

    def scale(self) -> dict[str, Any]:
        """Draw the scale below the drawings; plotly draws it for a trace, which shows nothing else."""
        bar = {"orientation": "h", "thickness": 10, "len": 0.7, "y": 0, "yanchor": "top", "ypad": 4, "nticks": 5}
        bar |= {"title": {"text": self.title, "side": "bottom", "font": {"size": 11}}, "tickfont": {"size": 11}}
        marker = {"color": [0], "cmin": self.limits[0], "cmax": self.limits[1], "showscale": True, "colorbar": bar}
        marker["colorscale"] = [[0.5 * k, stop] for k, stop in enumerate(self.stops)]
        return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "marker": marker, "showlegend": False}


def _by_mass(fit: Fit) -> _Colours:
    before, after = fit.literature.mass_kg, fit.estimate.mass_kg
    percent = np.full(len(before), np.nan)
    rows = fit.estimated_rows
    percent[rows] = 100 * (after[rows] / before[rows] - 1)
    sd = None if fit.posterior is None else fit.posterior.sd[:, 0]
    texts = []
    for i, name in enumerate(map(segment_name, fit.estimate.segments)):
        bar = "" if sd is None else f" ± {fixed(INTERVAL_SD * sd[i], 2)}"
        change = f"{fixed(after[i] - before[i], 2, sign=True)}{bar} kg ({fixed(percent[i], 0, sign=True)} %)"
        texts.append(f"{name}: {change if np.isfinite(percent[i]) else 'fixed'}")
    reach = max(_LEAST_PERCENT, float(np.nanmax(np.abs(percent), initial=0.0)))
    return _Colours(
        percent,
        (-reach, reach),
        (BLUE, "#FFFFFF", VERMILION),
        f"change of mass against {start_of(fit).phrase} (%)",
        texts,
        f"The body from the right, the front and the left, coloured by change of mass. {'; '.join(texts)}.",
    )


def _by_information(fit: Fit, posterior: Posterior) -> _Colours:
    percent = 100 * np.clip(posterior.information[:, 0], 0.0, 1.0)
    percent[np.setdiff1d(np.arange(len(percent)), fit.estimated_rows)] = np.nan
    words = fit.evidence[:, 0].tolist()
    texts = [
        f"{segment_name(name)}: {f'{value:.0f} % ({word})' if np.isfinite(value) else 'fixed'}"
        for name, value, word in zip(fit.estimate.segments, percent, words, strict=True)
    ]
    return _Colours(
        percent,
        (0.0, 100.0),
        ("#FFFFFF", between("#FFFFFF", BLUE, 0.5), BLUE),
        "information on the mass (%)",
        texts,
        f"The body from the right, the front and the left, coloured by how much the data inform each mass. "
        f"{'; '.join(texts)}.",
    )
