"""Draws marker errors: the distance of each marker from the model, and when it was not visible."""

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.trial_fit import TrialFit
from kinertia.report import style
from kinertia.report.figure import Figure, compact
from kinertia.report.panels import base_layout, plain
from kinertia.trial.data import Markers
from kinertia.trial.rms import rms_by_marker
from kinertia.trial.sampled_time import runs

_ROW_PX = 17
_LABELS = {"automargin": True, "dtick": 1, "gridcolor": "#EFEFEF"}


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
            ("ik", "inverse kinematics", "circle-open", style.ORANGE),
            ("final", "estimate", "circle", style.BLUE),
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
    line = {"type": "scatter", "mode": "lines", "x": x, "y": y, "line": {"width": 9, "color": style.VERMILION}}
    alt = f"Times at which markers of {name} were not seen: gaps in {len(gappy)} of {hidden.shape[1]} markers."
    layout = base_layout(alt)
    over = {"type": "rect", "xref": "x", "yref": "y domain", "y0": 0, "y1": 1, "line": {"width": 0}, "layer": "below"}
    blue = [{**over, "x0": first, "x1": last} for first, last in windows_s]
    layout |= {
        "height": 80 + _ROW_PX * len(names),
        "margin": {"t": 12, "b": 44, "l": 12, "r": 14},
        "xaxis": {"title": {"text": "time (s)"}, "range": [float(time[0]), float(time[-1])], "gridcolor": "#EFEFEF"},
        "yaxis": {**_LABELS, "range": [len(names) - 0.3, -0.7]},
        "shapes": [{**one, "fillcolor": style.SKY, "opacity": 0.18} for one in blue],
        "showlegend": False,
    }
    return Figure([{**line, "hovertemplate": "%{y}, %{x:.3f} s<extra></extra>"}], layout)


def fit_gap_figure(trial: TrialFit) -> Figure | None:
    """Draw the gaps of the model's markers in a trial that was fitted."""
    kinematics = trial.kinematics
    return gap_figure(kinematics.trial.markers.select(kinematics.ik.labels), kinematics.windows_s, trial.name)
