"""Figures of body segment parameters: intervals before and after, and what the data say about each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinertia.estimation.result import Fit
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.model.bsp import PARAMETERS
from kinertia.report import style
from kinertia.report.figure import Figure, compact
from kinertia.report.panels import Panel, base_layout, plain, small_multiples
from kinertia.report.wording import decimals, fixed, read_in, start_of

DEPARTURE_SD = 2.0
"""Estimates further from where they started than this many prior SDs are pointed out."""
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
"""The study's, first in `PARAMETERS`; products of inertia stay as they were."""


def segment_name(segment: str) -> str:
    """ "thigh_r" as "thigh, right"."""
    name, _, side = segment.rpartition("_")
    words = {"r": ", right", "l": ", left"}
    return (name + words[side] if name and side in words else segment).replace("_", " ")


def departures(fit: Fit) -> np.ndarray | None:
    """(s, 10) estimate minus start in prior SDs, 0 where held; None after two-level, which has none."""
    if fit.posterior is None:
        return None
    result: np.ndarray | None = (fit.estimate.table() - fit.literature.table()) / _scale(fit.posterior)
    return result


def _scale(posterior: Posterior) -> np.ndarray:
    """(s, 10) prior SDs; infinite where a parameter is held."""
    return np.where(posterior.prior_sd > 0, posterior.prior_sd, np.inf)


def estimated_rows(fit: Fit) -> np.ndarray:
    """Rows of the segments that were estimated; those with a prior SD of 0 stay as the model has them."""
    if fit.posterior is None:
        return np.arange(len(fit.estimate.segments))
    return np.flatnonzero((fit.posterior.prior_sd > 0).any(axis=1))


def bsp_figure(fit: Fit) -> Figure:
    """Estimate against start (literature, or OpenSim model): a panel per parameter, a row per segment.

    With error bars everything is in prior SDs, so that feet can be read beside the trunk; without (two-level),
    it is the difference in the parameter's unit. Segments that are held are left out.
    """
    away, posterior, start = departures(fit), fit.posterior, start_of(fit)
    shown = estimated_rows(fit)
    segments = [segment_name(fit.estimate.segments[i]) for i in shown]
    rows = {**_named(segments), "range": [len(segments) - 0.4, -0.6]}
    if away is None or posterior is None:
        change = fit.estimate.table() - fit.literature.table()
        panels = [_plain_panel(k, change[:, k], rows, start.word) for k in range(_ESTIMATED_BY_TWO_LEVEL)]
        axis: dict[str, Any] = {"nticks": 5}
        alt = f"Differences between estimate and {start.word} for every body segment parameter, without error bars."
    else:
        panels = [_panel(fit, posterior, shown, k, rows) for k in range(len(PARAMETERS))]
        away, half = away[shown], (_INTERVAL_SD * posterior.sd / _scale(posterior))[shown]
        reach = max(3.0, float((np.abs(away) + half).max()) + 0.2)
        title = {"text": f"prior SDs from {start.of}", "font": {"size": 11}, "standoff": 2}
        axis = {"range": [-reach, reach], "title": title, "nticks": 7}
        far = int((np.abs(away) > DEPARTURE_SD).sum())
        alt = (
            f"95 % intervals of every body segment parameter before and after the estimate; {far} of "
            f"{int((posterior.prior_sd > 0).sum())} estimates lie more than {DEPARTURE_SD:g} prior SDs from "
            f"{start.of}."
        )
    return small_multiples(panels, alt, axis, row_px=230, left_px=112, linked=away is not None)


def _panel(fit: Fit, posterior: Posterior, shown: np.ndarray, k: int, rows: dict[str, Any]) -> Panel:
    start = start_of(fit)
    before, after = fit.literature.table()[shown, k], fit.estimate.table()[shown, k]
    prior_sd, sd, scale = posterior.prior_sd[shown, k], posterior.sd[shown, k], _scale(posterior)[shown, k]
    away, half = (after - before) / scale, _INTERVAL_SD * sd / scale
    place = np.arange(len(shown))
    told = [
        f"{plain(segment_name(fit.estimate.segments[i]))}: {start.word} {_interval(k, b, p)}, "
        f"estimate {_interval(k, a, s)} {read_in(k)[0]}"
        for i, b, p, a, s in zip(shown, before, prior_sd, after, sd, strict=True)
    ]
    prior = {
        "type": "scatter",
        "mode": "markers",
        "x": compact(np.zeros(len(place))),
        "y": place.tolist(),
        "marker": {"symbol": "line-ns-open", "size": 9, "color": style.GREY},
        "error_x": {"type": "constant", "value": _INTERVAL_SD, "thickness": 7, "width": 0, "color": style.PALE},
        "name": f"{start.word}, 95 %",
        "hoverinfo": "skip",
    }
    far = np.abs(away) > DEPARTURE_SD
    traces = [prior]
    for chosen, name, colour, symbol in (
        (~far, "estimate, 95 %", style.BLUE, "circle"),
        (far, f"estimate beyond {DEPARTURE_SD:g} prior SDs", style.VERMILION, "diamond"),
    ):
        if chosen.any():
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "x": compact(away[chosen]),
                    "y": place[chosen].tolist(),
                    "marker": {"symbol": symbol, "size": 8, "color": colour},
                    "error_x": {"array": compact(half[chosen]), "thickness": 2.2, "width": 0, "color": colour},
                    "name": name,
                    "text": [line for line, yes in zip(told, chosen, strict=True) if yes],
                    "hovertemplate": "%{text}<extra></extra>",
                }
            )
    return Panel(NAMES[k], traces, (), rows)


def _interval(k: int, value: float, sd: float) -> str:
    factor, digits = read_in(k)[1], decimals(k, sd)
    return f"{fixed(factor * value, digits)} ± {fixed(factor * sd, digits)}"


def _plain_panel(k: int, change: np.ndarray, rows: dict[str, Any], start: str) -> Panel:
    unit, factor = read_in(k)
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": compact(factor * change),
        "y": list(range(len(change))),
        "marker": {"size": 8, "color": style.BLUE},
        "name": f"estimate minus {start}",
        "hovertemplate": f"%{{y}}: %{{x:.3g}} {unit}<extra></extra>",
    }
    return Panel(f"{NAMES[k]} ({unit})", [trace], (), rows)


def information_figure(fit: Fit) -> Figure | None:
    """Information (100 % is everything) on every parameter of the estimated segments; None after two-level.

    The tiles of the map are bars, which plotly's basic bundle has; it has no heat maps.
    """
    if fit.posterior is None:
        return None
    shown = estimated_rows(fit)
    told = 100 * np.clip(fit.posterior.information[shown], 0.0, 1.0)
    segments = [segment_name(fit.estimate.segments[i]) for i in shown]
    best = np.unravel_index(int(np.nanargmax(told)), told.shape)
    alt = (
        f"Map of what the data say about each parameter, in percent; most about {NAMES[best[1]]} of "
        f"{segments[best[0]]}, {told[best]:.0f} %; median {np.nanmedian(told):.0f} %."
    )
    rows, columns = np.nonzero(np.isfinite(told))
    values = told[rows, columns]
    tiles = {
        "type": "bar",
        "orientation": "h",
        "base": (columns - 0.5).tolist(),
        "x": [1] * len(values),
        "y": rows.tolist(),
        "width": 1,
        "marker": {
            "color": compact(values),
            "cmin": 0,
            "cmax": 100,
            "colorscale": [[0, "#FFFFFF"], [1, style.BLUE]],
            "line": {"color": "#FFFFFF", "width": 2},
        },
        "text": [f"{value:.0f}" for value in values],
        "textposition": "inside",
        "insidetextanchor": "middle",
        "textangle": 0,
        "constraintext": "none",
        "textfont": {"size": 11},
        "customdata": [f"{NAMES[k]} of {plain(segments[i])}" for i, k in zip(rows, columns, strict=True)],
        "hovertemplate": "%{customdata}: %{text} %<extra></extra>",
    }
    layout = base_layout(alt)
    tidy = {"fixedrange": True, "showgrid": False, "zeroline": False, "ticks": "outside"}
    layout |= {
        "height": 110 + 30 * len(segments),
        "margin": {"t": 100, "b": 10, "l": 112, "r": 34},
        "xaxis": {**tidy, "side": "top", "tickangle": -40, **_named(NAMES), "range": [-0.5, len(NAMES) - 0.5]},
        "yaxis": {**tidy, **_named(segments), "range": [len(segments) - 0.5, -0.5]},
    }
    return Figure([tiles], layout)


def _named(words: Sequence[str]) -> dict[str, Any]:
    """An axis with words at 0, 1, 2, ..."""
    return {"tickvals": list(range(len(words))), "ticktext": [plain(word) for word in words]}
