"""Draws figures of the studies: a row per recording, trial or laboratory."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from kinertia.report import style
from kinertia.report.figure import Figure
from kinertia.report.panels import Panel, base_layout, plain, small_multiples

_COLOURS = (style.GREY, style.BLUE, style.ORANGE, style.GREEN)
_BARS = (style.BLUE, style.SKY, style.PALE, style.VERMILION)
_SYMBOLS = ("circle-open", "circle", "diamond", "square")
_ROW_PX, _LEFT_PX, _LETTERS = 34, 150, 22


def dot_figure(names: Sequence[str], panels: Mapping[str, Mapping[str, Sequence[float]]], alt: str) -> Figure:
    """Draw a panel per quantity, with a row per name and a dot per series.

    Args:
        names: names of the rows, downwards.
        panels: title with unit -> series -> a value per row.
        alt: text alternative of the figure.
    """
    drawn = []
    only = all(len(series) == 1 for series in panels.values())
    symbols, colours = (_SYMBOLS[1:], _COLOURS[1:]) if only else (_SYMBOLS, _COLOURS)
    for title, series in panels.items():
        traces = [
            {
                "type": "scatter",
                "mode": "markers",
                "x": [float(value) for value in values],
                "y": list(range(len(names))),
                "name": plain(name),
                "marker": {"symbol": symbols[k], "size": 9, "color": colours[k], "line": {"width": 1.5}},
                "text": [f"{plain(row)}: {value:.3g}" for row, value in zip(names, values, strict=True)],
                "hovertemplate": "%{text}<extra>%{fullData.name}</extra>",
            }
            for k, (name, values) in enumerate(series.items())
        ]
        drawn.append(Panel(title, traces, (), _rows(names)))
    x = {"rangemode": "tozero", "nticks": 5}
    return small_multiples(drawn, alt, x, row_px=40 + _ROW_PX * len(names), left_px=_LEFT_PX, linked=False)


def bar_figure(names: Sequence[str], series: Mapping[str, Sequence[float]], alt: str, title: str) -> Figure:
    """Draw a row per name with a bar of all series, stacked; `title` states what they count."""
    traces = [
        {
            "type": "bar",
            "orientation": "h",
            "x": list(values),
            "y": list(range(len(names))),
            "name": plain(name),
            "marker": {"color": _BARS[k]},
            "hovertemplate": "%{x}<extra>%{fullData.name}</extra>",
        }
        for k, (name, values) in enumerate(series.items())
    ]
    layout = base_layout(alt)
    layout |= {
        "legend": {**layout["legend"], "traceorder": "normal", "xref": "container"},
        "height": 136 + _ROW_PX * len(names),
        "margin": {"t": 70, "b": 48, "l": _LEFT_PX, "r": 14},
        "barmode": "stack",
        "xaxis": {"title": {"text": title, "standoff": 4, "font": {"size": 11}}, "gridcolor": "#EFEFEF"},
        "yaxis": _rows(names),
    }
    return Figure(traces, layout)


def _rows(names: Sequence[str]) -> dict[str, Any]:
    """Return the vertical axis with a name per row, downwards."""
    texts = ["<br>".join(plain(line) for line in textwrap.wrap(name, _LETTERS)) for name in names]
    ticks = {"tickmode": "array", "tickvals": list(range(len(names))), "ticktext": texts, "tickfont": {"size": 10}}
    return {**ticks, "range": [len(names) - 0.4, -0.6], "zeroline": False}
