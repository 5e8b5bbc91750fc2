"""Figures of body segment parameters: intervals before and after, and what the data told about each."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from kinertia.bsp import PARAMETERS, UNITS
from kinertia.fit import Fit
from kinertia.report import style
from kinertia.report.panels import Panel, base_layout, compact, small_multiples
from kinertia.simultaneous_fit import Posterior

DEPARTURE_SD = 2.0
"""Estimates further from the literature than this many of its deviations are pointed out."""
NAMES = (
    "mass",
    "CoM forward",
    "CoM upward",
    "CoM to the right",
    "Ixx",
    "Iyy",
    "Izz",
    "Ixy",
    "Ixz",
    "Iyz",
)
"""Of `PARAMETERS`, in words."""
_INTERVAL_SD = 1.96
_ESTIMATED_BY_TWO_LEVEL = 7
"""The study's, first in `PARAMETERS`; products of inertia stay the literature's."""
_READ_IN = {"m": ("mm", 1e3)}


def read_in(k: int) -> tuple[str, float]:
    """Unit in which people read parameter k of `PARAMETERS` (kg, mm, kg m2), and the factor to it."""
    return _READ_IN.get(UNITS[k], (UNITS[k], 1.0))


def segment_name(segment: str) -> str:
    """ "thigh_r" as "thigh, right"."""
    name, _, side = segment.rpartition("_")
    words = {"r": ", right", "l": ", left"}
    return (name + words[side] if name and side in words else segment).replace("_", " ")


def departures(fit: Fit) -> np.ndarray | None:
    """(s, 10) estimate minus literature in the literature's deviations; None after two-level, which has none."""
    if fit.posterior is None:
        return None
    return (fit.estimate.table() - fit.literature.table()) / _scale(fit.posterior)


def _scale(posterior: Posterior) -> np.ndarray:
    """(s, 10) the literature's deviations; infinite where a parameter is fixed."""
    return np.where(posterior.prior_sd > 0, posterior.prior_sd, np.inf)


def bsp_figure(fit: Fit) -> go.Figure:
    """Estimate against literature: a panel per parameter, a row per segment.

    With error bars everything is in deviations of the literature, so that feet can be read beside the trunk; without
    (two-level), it is the difference in the parameter's unit.
    """
    away, posterior = departures(fit), fit.posterior
    segments = [segment_name(name) for name in fit.estimate.segments]
    rows = {"tickvals": list(range(len(segments))), "ticktext": segments, "range": [len(segments) - 0.4, -0.6]}
    if away is None or posterior is None:
        change = fit.estimate.table() - fit.literature.table()
        panels = [_plain_panel(k, change[:, k], rows) for k in range(_ESTIMATED_BY_TWO_LEVEL)]
        axis: dict[str, Any] = {"nticks": 5}
        alt = "Differences between estimate and literature for every body segment parameter, without error bars."
    else:
        panels = [_panel(fit, posterior, away, k, rows) for k in range(len(PARAMETERS))]
        half = _INTERVAL_SD * posterior.sd / _scale(posterior)
        reach = max(3.0, float((np.abs(away) + half).max()) + 0.2)
        title = {"text": "deviations of the literature", "font": {"size": 11}, "standoff": 2}
        axis = {"range": [-reach, reach], "title": title, "nticks": 7}
        far = int((np.abs(away) > DEPARTURE_SD).sum())
        alt = (
            f"95 % intervals of every body segment parameter before and after the estimate; {far} of {away.size} "
            f"estimates lie more than {DEPARTURE_SD:g} deviations from the literature."
        )
    return small_multiples(panels, alt, axis, row_px=230, left_px=112, linked=away is not None)


def _panel(fit: Fit, posterior: Posterior, away: np.ndarray, k: int, rows: dict[str, Any]) -> Panel:
    half = _INTERVAL_SD * (posterior.sd / _scale(posterior))[:, k]
    place = np.arange(len(away))
    before, after = fit.literature.table()[:, k], fit.estimate.table()[:, k]
    unit, factor = read_in(k)
    columns = (before, posterior.prior_sd[:, k], after, posterior.sd[:, k])
    told = [
        f"{segment_name(segment)}: literature {b:.4g} ± {p:.2g}, estimate {a:.4g} ± {s:.2g} {unit}"
        for segment, b, p, a, s in zip(fit.estimate.segments, *(factor * column for column in columns), strict=True)
    ]
    prior = {
        "type": "scatter",
        "mode": "markers",
        "x": compact(np.zeros(len(away))),
        "y": place,
        "marker": {"symbol": "line-ns-open", "size": 9, "color": style.GREY},
        "error_x": {"type": "constant", "value": _INTERVAL_SD, "thickness": 7, "width": 0, "color": style.PALE},
        "name": "literature, 95 %",
        "hoverinfo": "skip",
    }
    far = np.abs(away[:, k]) > DEPARTURE_SD
    traces = [prior]
    for chosen, name, colour, symbol in (
        (~far, "estimate, 95 %", style.BLUE, "circle"),
        (far, f"estimate beyond {DEPARTURE_SD:g} deviations", style.VERMILION, "diamond"),
    ):
        if chosen.any():
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "x": compact(away[chosen, k]),
                    "y": place[chosen],
                    "marker": {"symbol": symbol, "size": 8, "color": colour},
                    "error_x": {"array": compact(half[chosen]), "thickness": 2.2, "width": 0, "color": colour},
                    "name": name,
                    "text": [line for line, yes in zip(told, chosen, strict=True) if yes],
                    "hovertemplate": "%{text}<extra></extra>",
                }
            )
    return Panel(NAMES[k], traces, (), rows)


def _plain_panel(k: int, change: np.ndarray, rows: dict[str, Any]) -> Panel:
    unit, factor = read_in(k)
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": compact(factor * change),
        "y": np.arange(len(change)),
        "marker": {"size": 8, "color": style.BLUE},
        "name": "estimate minus literature",
        "hovertemplate": f"%{{y}}: %{{x:.3g}} {unit}<extra></extra>",
    }
    return Panel(f"{NAMES[k]} ({unit})", [trace], (), rows)


def information_figure(fit: Fit) -> go.Figure | None:
    """Information on every parameter (100 % is everything), segments by parameters; None after two-level."""
    if fit.posterior is None:
        return None
    told = 100 * np.clip(fit.posterior.information, 0.0, 1.0)
    segments = [segment_name(name) for name in fit.estimate.segments]
    best = np.unravel_index(int(np.argmax(told)), told.shape)
    alt = (
        f"Map of what the data told about each parameter, in percent; most about {NAMES[best[1]]} of "
        f"{segments[best[0]]}, {told[best]:.0f} %; median {np.median(told):.0f} %."
    )
    heat = {
        "type": "heatmap",
        "z": compact(told),
        "x": list(NAMES),
        "y": segments,
        "zmin": 0,
        "zmax": 100,
        "colorscale": [[0, "#FFFFFF"], [1, style.BLUE]],
        "xgap": 2,
        "ygap": 2,
        "texttemplate": "%{z:.0f}",
        "textfont": {"size": 11},
        "showscale": False,
        "hovertemplate": "%{x} of %{y}: %{z:.0f} %<extra></extra>",
    }
    layout = base_layout(alt)
    layout |= {
        "height": 110 + 30 * len(segments),
        "margin": {"t": 100, "b": 10, "l": 112, "r": 34},
        "xaxis": {"side": "top", "tickangle": -40, "fixedrange": True},
        "yaxis": {"autorange": "reversed", "fixedrange": True},
    }
    return go.Figure([heat], layout)
