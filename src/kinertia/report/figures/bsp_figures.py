"""Draws body segment parameters: changes with intervals, and how well the data inform each."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinertia.estimation.result.fit import Fit
from kinertia.estimation.simultaneous.fit import Posterior
from kinertia.model.bsp import BodySegmentParameters
from kinertia.report.figures.figure import (
    BLACK,
    BLUE,
    PALE,
    VERMILION,
    Figure,
    Panel,
    base_layout,
    between,
    compact,
    plain,
    small_multiples,
)
from kinertia.report.wording import INTERVAL_SD, decimals, expected_of, fixed, read_in

DEPARTURE_SD = 2.0
"""Estimates further from the prior's mean than this many prior SDs are pointed out."""
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
"""Names of `PARAMETERS`, in words."""
MASS_AND_COM, MAIN, PRODUCTS = range(4), range(7), range(7, 10)
"""Columns of `PARAMETERS`; two-level leaves the products of inertia as they were."""


def segment_name(segment: str) -> str:
    """Title a segment: "thigh_r" as "thigh, right"."""
    name, _, side = segment.rpartition("_")
    words = {"r": ", right", "l": ", left"}
    return (name + words[side] if name and side in words else segment).replace("_", " ")


def _scale(posterior: Posterior) -> np.ndarray:
    """Return prior SDs (s, 10); infinite where a parameter is fixed."""
    return np.where(posterior.prior_sd > 0, posterior.prior_sd, np.inf)


def change_figure(fit: Fit, columns: Sequence[int] = MAIN, truth: BodySegmentParameters | None = None) -> Figure:
    """Draw the change of these parameters in kg, mm and kg m2: a panel per parameter, a row per segment.

    With 95 % intervals of prior and estimate, where there are any (not after two-level). Fixed segments are
    left out. `truth_comparison`: of a synthetic person, as diamonds.
    """
    posterior, start = fit.posterior, expected_of(fit)
    shown, rows = _rows(fit)
    panels = []
    for k in columns:
        unit, factor = read_in(k)
        scale = np.full(len(shown), 1 / factor)
        traces = _traces(fit, shown, k, scale)
        if truth is not None:
            away = (truth.table() - fit.expected.table())[shown, k]
            texts = [f"{plain(segment_name(fit.estimate.segments[i]))}: truth" for i in shown]
            look = {"symbol": "diamond-open", "size": 10, "color": BLACK, "line": {"width": 1.5}}
            traces.append(_dots(away / scale, np.arange(len(shown)), texts) | {"marker": look, "name": "truth"})
        panels.append(Panel(f"{NAMES[k]} ({unit})", traces, (), rows))
    bars = "without error bars" if posterior is None else "with 95 % intervals before and after"
    alt = f"Change against {start.phrase} by the estimate, {bars}: {', '.join(NAMES[k] for k in columns)}."
    return small_multiples(panels, alt, {"nticks": 5}, row_px=230, left_px=112, linked=False)


def departure_figure(fit: Fit, columns: Sequence[int] = MAIN) -> Figure | None:
    """Draw the changes in prior SDs, so that feet and trunk share a scale; None after two-level, which has none."""
    away, posterior, start = fit.departures, fit.posterior, expected_of(fit)
    if away is None or posterior is None:
        return None
    shown, rows = _rows(fit)
    scale = _scale(posterior)
    panels = [Panel(NAMES[k], _traces(fit, shown, k, scale[shown, k]), (), rows) for k in columns]
    part = np.ix_(shown, np.array(columns))
    away, half = away[part], (INTERVAL_SD * posterior.sd / scale)[part]
    reach = max(3.0, float((np.abs(away) + half).max()) + 0.2)
    title = {"text": f"prior SDs from {start.phrase}", "font": {"size": 11}, "standoff": 2}
    alt = (
        f"95 % intervals before and after the estimate in prior SDs: {', '.join(NAMES[k] for k in columns)}; "
        f"{int((np.abs(away) > DEPARTURE_SD).sum())} of {int((posterior.prior_sd[part] > 0).sum())} estimates lie more "
        f"than {DEPARTURE_SD:g} prior SDs from {start.phrase}."
    )
    axis = {"range": [-reach, reach], "title": title, "nticks": 7}
    return small_multiples(panels, alt, axis, row_px=230, left_px=112)


def _rows(fit: Fit) -> tuple[np.ndarray, dict[str, Any]]:
    """Return rows of the segments shown, and the axis with their names, downwards."""
    shown = fit.estimated_rows
    names = [segment_name(fit.estimate.segments[i]) for i in shown]
    return shown, {**_named(names), "range": [len(names) - 0.4, -0.6]}


def _traces(fit: Fit, shown: np.ndarray, k: int, scale: np.ndarray) -> list[dict[str, Any]]:
    """Draw the change of parameter k in units of `scale` per segment; fixed parameters are left out."""
    posterior, start = fit.posterior, expected_of(fit)
    before, after = fit.expected.table()[shown, k], fit.estimate.table()[shown, k]
    away, place = (after - before) / scale, np.arange(len(shown))
    names = [plain(segment_name(fit.estimate.segments[i])) for i in shown]
    if posterior is None:
        texts = [f"{name}: {_change(k, a - b)}" for name, b, a in zip(names, before, after, strict=True)]
        return [_dots(away, place, texts) | {"name": f"estimate minus {start.word}"}]
    prior_sd, sd = posterior.prior_sd[shown, k], posterior.sd[shown, k]
    half = INTERVAL_SD * sd / scale
    texts = [
        f"{name}: {start.word} {_interval(k, b, p)}, estimate {_interval(k, a, s)} {read_in(k)[0]}"
        for name, b, p, a, s in zip(names, before, prior_sd, after, sd, strict=True)
    ]
    free = prior_sd > 0
    traces: list[dict[str, Any]] = [
        {
            "type": "scatter",
            "mode": "markers",
            "x": compact(np.zeros(int(free.sum()))),
            "y": place[free].tolist(),
            "marker": {"symbol": "square", "size": 7, "color": PALE},
            "error_x": _bars(INTERVAL_SD * prior_sd[free] / scale[free], 7, PALE),
            "name": f"{start.word}, 95 %",
            "hoverinfo": "skip",
        }
    ]
    far = np.abs(after - before) > DEPARTURE_SD * prior_sd
    for chosen, name, colour, symbol in (
        (free & ~far, "estimate, 95 %", BLUE, "circle"),
        (free & far, f"estimate beyond {DEPARTURE_SD:g} prior SDs", VERMILION, "diamond"),
    ):
        if chosen.any():
            dots = _dots(away[chosen], place[chosen], [line for line, yes in zip(texts, chosen, strict=True) if yes])
            look = {"symbol": symbol, "size": 8, "color": colour}
            traces.append(dots | {"marker": look, "error_x": _bars(half[chosen], 2.2, colour), "name": name})
    return traces


def _dots(x: np.ndarray, place: np.ndarray, texts: list[str]) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "markers",
        "x": compact(x),
        "y": place.tolist(),
        "marker": {"size": 8, "color": BLUE},
        "text": texts,
        "hovertemplate": "%{text}<extra></extra>",
    }


def _bars(half: np.ndarray, thickness: float, colour: str) -> dict[str, Any]:
    return {"array": compact(half), "thickness": thickness, "width": 0, "color": colour}


def _change(k: int, value: float) -> str:
    unit, factor = read_in(k)
    return f"{fixed(factor * value, decimals(k, abs(value)), sign=True)} {unit}"


def _interval(k: int, value: float, sd: float) -> str:
    factor, digits = read_in(k)[1], decimals(k, sd)
    return f"{fixed(factor * value, digits)} ± {fixed(factor * sd, digits)}"


def information_figure(fit: Fit) -> Figure | None:
    """Draw the variance reduction (100 % is complete) of each parameter of estimated segments; None after two-level.

    The tiles of the map are bars, which plotly's basic bundle has; it has no heat maps.
    """
    if fit.posterior is None:
        return None
    shown = fit.estimated_rows
    percent = 100 * np.clip(fit.posterior.information[shown], 0.0, 1.0)
    segments = [segment_name(fit.estimate.segments[i]) for i in shown]
    best = np.unravel_index(int(np.nanargmax(percent)), percent.shape)
    alt = (
        f"Map of how much the data inform each parameter, in percent; most of all {NAMES[best[1]]} of "
        f"{segments[best[0]]}, {percent[best]:.0f} %; median {np.nanmedian(percent):.0f} %."
    )
    rows, columns = np.nonzero(np.isfinite(percent))
    values = percent[rows, columns]
    tiles = {
        "type": "bar",
        "orientation": "h",
        "base": (columns - 0.5).tolist(),
        "x": [1] * len(values),
        "y": rows.tolist(),
        "width": 1,
        # colours in place of numbers on a scale: of each number plotly.js warns where it chooses the letters
        "marker": {
            "color": [between("#FFFFFF", BLUE, value / 100) for value in values],
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
    """Return an axis with words at 0, 1, 2, ..."""
    return {"tickvals": list(range(len(words))), "ticktext": [plain(word) for word in words]}
