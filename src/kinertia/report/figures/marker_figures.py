"""Draws marker errors over time, and the labelled markers of a recording as a figure to turn."""

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.model.marker_set import MarkerSet
from kinertia.report.figures.figure import BLUE, ORANGE, SKY, VERMILION, Figure, base_layout, compact, plain
from kinertia.report.figures.skeleton_view import Scene, plate_corners
from kinertia.trial.data import Markers, Recording
from kinertia.trial.sampled_data import rms_by_marker, runs

_ROW_PX = 17
_LABELS = {"automargin": True, "dtick": 1, "gridcolor": "#EFEFEF"}
_CHAIN = (
    ("pelvis", "torso"),
    *(
        (parent.format(side), f"{child}_{side}")
        for side in "rl"
        for parent, child in (
            ("pelvis", "thigh"),
            ("thigh_{}", "shank"),
            ("shank_{}", "foot"),
            ("torso", "upper_arm"),
            ("upper_arm_{}", "forearm"),
        )
    ),
)
"""Segments of a marker set that are drawn as joined, by the middle of their markers."""


def marker_figure(trial: TrialFit, drifting: tuple[str, ...] = ()) -> Figure:
    """Draw the RMS distance (mm) between every measured and modelled marker over the window; the farthest on top.

    `drifting` lists the markers that drift and are down-weighted.
    """
    labels = trial.kinematics.ik.labels
    distances_mm = {stage: 1e3 * rms_by_marker(errors) for stage, errors in trial.marker_errors_m.items()}
    order = np.argsort(-np.nan_to_num(distances_mm["final"], nan=-1.0))
    names = [plain(labels[k]) + (" (down-weighted)" if labels[k] in drifting else "") for k in order]
    traces = [
        {
            "type": "scatter",
            "mode": "markers",
            "x": compact(distances_mm[stage][order]),
            "y": names,
            "name": name,
            "marker": {"symbol": symbol, "size": 9, "color": colour, "line": {"width": 1.5, "color": colour}},
            "hovertemplate": "%{y}: %{x:.1f} mm<extra>%{fullData.name}</extra>",
        }
        for stage, name, symbol, colour in (
            ("ik", "inverse kinematics", "circle-open", ORANGE),
            ("final", "estimate", "circle", BLUE),
        )
    ]
    worst = order[0]
    alt = (
        f"Distance between measured and modelled markers of {trial.name}; the largest after the estimate is "
        f"{distances_mm['final'][worst]:.0f} mm at {labels[worst]}."
    )
    layout = base_layout(alt)
    layout |= {
        "height": 100 + _ROW_PX * len(names),
        "margin": {"t": 40, "b": 44, "l": 12, "r": 14},
        "xaxis": {"title": {"text": "RMS distance (mm)"}, "rangemode": "tozero", "gridcolor": "#EFEFEF"},
        "yaxis": {**_LABELS, "range": [len(names) - 0.3, -0.7]},
    }
    return Figure(traces, layout)


def gap_figure(markers: Markers, windows_s: Sequence[tuple[float, float]], name: str) -> Figure | None:
    """Draw when each marker was not visible, over the whole trial; None if all always were.

    Args:
        markers: markers of the model or the marker set.
        windows_s: first and last time of the windows that a fit uses, shaded blue.
        name: name of the trial.
    """
    time, hidden = markers.time, ~markers.seen
    gappy = [k for k in range(hidden.shape[1]) if hidden[:, k].any()]
    if not gappy or len(time) < 2:
        return None
    names = [plain(markers.labels[k]) for k in gappy]
    x: list[float | None] = []
    y: list[str | None] = []
    half = 0.5 * float(time[1] - time[0])
    for label, k in zip(names, gappy, strict=True):
        for first, last in runs(hidden[:, k]):
            x += [round(float(time[first]) - half, 4), round(float(time[last]) + half, 4), None]
            y += [label, label, None]
    line = {"type": "scatter", "mode": "lines", "x": x, "y": y, "line": {"width": 9, "color": VERMILION}}
    alt = f"Times at which markers of {name} were not seen: gaps in {len(gappy)} of {hidden.shape[1]} markers."
    layout = base_layout(alt)
    over = {"type": "rect", "xref": "x", "yref": "y domain", "y0": 0, "y1": 1, "line": {"width": 0}, "layer": "below"}
    blue = [{**over, "x0": first, "x1": last} for first, last in windows_s]
    layout |= {
        "height": 80 + _ROW_PX * len(names),
        "margin": {"t": 12, "b": 44, "l": 12, "r": 14},
        "xaxis": {"title": {"text": "time (s)"}, "range": [float(time[0]), float(time[-1])], "gridcolor": "#EFEFEF"},
        "yaxis": {**_LABELS, "range": [len(names) - 0.3, -0.7]},
        "shapes": [{**shape, "fillcolor": SKY, "opacity": 0.18} for shape in blue],
        "showlegend": False,
    }
    return Figure([{**line, "hovertemplate": "%{y}, %{x:.3f} s<extra></extra>"}], layout)


def fit_gap_figure(trial: TrialFit) -> Figure | None:
    """Draw the gaps of the model's markers in a trial that was fitted."""
    kinematics = trial.kinematics
    return gap_figure(kinematics.trial.markers.select(kinematics.ik.labels), kinematics.windows_s, trial.name)


def marker_scene(recording: Recording, marker_set: MarkerSet | None, most_frames: int) -> Scene:
    """Show the markers of the set with their names, in at most `most_frames` frames.

    Each is joined to the middle of its segment's markers, and so are neighbouring segments: a swapped or drifting label
    draws a long line. Without a marker set all markers are shown, and nothing is joined.
    """
    markers = recording.markers
    if marker_set is not None:
        markers = markers.select([label for label in marker_set.labels if label in markers.labels])
    chosen = slice(None, None, -(-len(markers.time) // most_frames))
    positions = markers.positions[chosen]
    segments: dict[str, list[int]] = {}
    if marker_set is not None:
        for name, labels in marker_set.segments.items():
            segments[name] = [markers.labels.index(label) for label in labels if label in markers.labels]
    segments = {name: rows for name, rows in segments.items() if rows}
    middles = [_middle(positions[:, rows]) for rows in segments.values()]
    names = list(segments)
    bones, sides = [], []
    for k, (name, rows) in enumerate(segments.items()):
        bones += [(row, len(markers.labels) + k) for row in rows if len(rows) > 1]
        sides += [_side(name) for _ in rows if len(rows) > 1]
    for parent, child in _CHAIN:
        if parent in segments and child in segments:
            bones.append((len(markers.labels) + names.index(parent), len(markers.labels) + names.index(child)))
            sides.append(_side(child))
    pelvis = segments.get("pelvis") or list(range(len(markers.labels)))
    return Scene(
        time=markers.time[chosen],
        centre=_bridged(_middle(positions[:, pelvis])),
        bones=np.array(bones, dtype=int).reshape(-1, 2),
        sides=tuple(sides),
        points=np.concatenate([positions, *(middle[:, None] for middle in middles)], axis=1),
        measured=positions,
        labels=markers.labels,
        plates=plate_corners(None if recording.plates is None else recording.plates.corners),
    )


def _side(segment: str) -> str:
    return segment[-1] if segment.endswith(("_r", "_l")) else ""


def _middle(positions: np.ndarray) -> np.ndarray:
    """Return the mean (n, 3) of the visible markers (n, m, 3); NaN where none is."""
    seen = np.isfinite(positions).all(axis=2)
    total = np.where(seen[..., None], positions, 0.0).sum(axis=1)
    with np.errstate(invalid="ignore"):
        result: np.ndarray = total / seen.sum(axis=1)[:, None]
        return result


def _bridged(path: np.ndarray) -> np.ndarray:
    """Return the path (n, 3) with straight lines across gaps; the origin where nothing is known."""
    known = np.flatnonzero(np.isfinite(path).all(axis=1))
    if not len(known):
        return np.zeros_like(path)
    at = np.arange(len(path))
    columns: Sequence[np.ndarray] = [np.interp(at, known, path[known, k]) for k in range(3)]
    return np.stack(columns, axis=1)
