"""Lays out small multiples: many panels in one plotly figure.

The page rearranges the panels for its width: `layout.meta.arrangements` holds the input of plotly's `relayout` for each
number of columns and for "print".
"""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kinertia.report import style
from kinertia.report.figure import Figure

_BOTTOM_PX, _RIGHT_PX = 44, 14
_LEGEND_ROW_PX, _LEGEND_PER_ROW = 27, {1: 1, 2: 2, 3: 4}
_TITLE_PX, _TICKS_PX, _NOMINAL_WIDTH_PX = 30, 40, 960
MOST_COLUMNS = 3
_PAPER_PX = 620
"""Rows of panels on a sheet of paper, below the table of strides, at the scale of the page's print style."""


@dataclass(frozen=True)
class Panel:
    """One panel of a figure.

    Attributes:
        title: title with the unit.
        traces: plotly traces without their axes.
        shapes: plotly shapes without their axes; `yref` "domain" spans the height of the panel, `xref` its width.
        y: further settings of the vertical axis.
    """

    title: str
    traces: Sequence[dict[str, Any]]
    shapes: Sequence[dict[str, Any]] = ()
    y: dict[str, Any] | None = None


def plain(text: str) -> str:
    """Escape text that plotly would interpret as markup, which names of markers and trials may contain."""
    return html.escape(text)


def shaded(first: float, last: float, colour: str) -> dict[str, Any]:
    """Shade the panel from one value of the horizontal axis to another."""
    place = {"x0": first, "x1": last, "y0": 0, "y1": 1, "yref": "domain"}
    return {"type": "rect", **place, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def small_multiples(
    panels: Sequence[Panel], alt: str, x: dict[str, Any], row_px: int = 170, left_px: int = 52, linked: bool = True
) -> Figure:
    """Arrange panels of one kind as one figure.

    Args:
        panels: panels from left to right, then downwards.
        alt: text alternative of the figure.
        x: settings of the horizontal axes.
        row_px: height of a panel.
        left_px: room for the labels of a vertical axis.
        linked: whether all panels have the same horizontal range.
    """
    data, shapes, titles = [], [], []
    axes: dict[str, Any] = {}
    shown: set[str] = set()
    for k, panel in enumerate(panels):
        suffix = "" if k == 0 else str(k + 1)
        axes[f"xaxis{suffix}"] = {**_AXIS, **x, "anchor": f"y{suffix}", **({"matches": "x"} if k and linked else {})}
        axes[f"yaxis{suffix}"] = {**_AXIS, **(panel.y or {}), "anchor": f"x{suffix}"}
        for trace in panel.traces:
            name = trace.get("name", "")
            first = bool(name) and trace.get("showlegend", True) and name not in shown
            shown |= {name} if first else set()
            place = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "legendgroup": name, "showlegend": first}
            data.append({**trace, **place})
        for shape in panel.shapes:
            refs = {ref: f"{ref[0]}{suffix}{' domain' if shape.get(ref) else ''}" for ref in ("xref", "yref")}
            shapes.append({**shape, **refs})
        place = {"xref": f"x{suffix} domain", "yref": f"y{suffix} domain", "x": 0, "y": 1}
        anchors = {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "font": {"size": 12}}
        titles.append({"text": f"<b>{plain(panel.title)}</b>", **place, **anchors})
    ways: dict[str, Any] = {
        str(c): _arrangement(len(panels), c, row_px, left_px, len(shown)) for c in range(1, MOST_COLUMNS + 1)
    }
    rows = math.ceil(len(panels) / MOST_COLUMNS)
    on_paper_px = min(row_px, _PAPER_PX // rows - _TITLE_PX - _TICKS_PX)
    ways["print"] = _arrangement(len(panels), MOST_COLUMNS, max(on_paper_px, 80), left_px, len(shown))
    layout = {**base_layout(alt), **axes, "shapes": shapes, "annotations": titles}
    layout["meta"] = {**layout["meta"], "arrangements": ways}
    return Figure(data, _arranged(layout, ways[str(MOST_COLUMNS)]))


def _arranged(layout: dict[str, Any], flat: dict[str, Any]) -> dict[str, Any]:
    """Apply the settings of an arrangement, whose names are paths such as "xaxis2.domain", to the layout."""
    result = dict(layout)
    for path, value in flat.items():
        name, _, inner = path.partition(".")
        result[name] = {**result[name], inner: value} if inner else value
    return result


_AXIS = {
    "zeroline": True,
    "zerolinecolor": style.PALE,
    "zerolinewidth": 1,
    "gridcolor": "#EFEFEF",
    "linecolor": style.GREY,
    "ticks": "outside",
    "ticklen": 3,
    "tickfont": {"size": 11},
    "automargin": False,
}


def base_layout(alt: str) -> dict[str, Any]:
    """Return the common layout of figures: font, white ground, legend on top, text `alt`, and no notebook template."""
    return {
        "template": {},
        "font": {"family": style.FONT, "size": 12, "color": "#1A1A1A"},
        "paper_bgcolor": "#FFFFFF",
        "plot_bgcolor": "#FFFFFF",
        "margin": {"t": _TITLE_PX, "b": _BOTTOM_PX, "l": 52, "r": _RIGHT_PX},
        "legend": {"orientation": "h", "yref": "container", "y": 1, "yanchor": "top", "x": 0, "xanchor": "left"},
        "hovermode": "closest",
        "meta": {"alt": alt},
    }


def sentence_figure(text: str) -> Figure:
    """Show words in place of a figure that has nothing to show."""
    layout = base_layout(text)
    hidden = {"visible": False}
    place = {"xref": "paper", "yref": "paper", "x": 0, "y": 0.5, "xanchor": "left", "showarrow": False}
    layout |= {"height": 90, "xaxis": hidden, "yaxis": hidden, "annotations": [{"text": plain(text), **place}]}
    return Figure([], layout)


def _arrangement(count: int, columns: int, row_px: int, left_px: int, legend: int) -> dict[str, Any]:
    """Return domains of all axes, top margin and height of the figure, for this many columns and legend entries.

    Fewer panels than columns fill the width.
    """
    legend_rows = math.ceil(legend / _LEGEND_PER_ROW[columns])
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    inner_px = rows * row_px + (rows - 1) * (_TITLE_PX + _TICKS_PX)
    gap = (left_px + 6) / (_NOMINAL_WIDTH_PX - left_px - _RIGHT_PX)
    width = (1 - (columns - 1) * gap) / columns
    top_px = _TITLE_PX + _LEGEND_ROW_PX * legend_rows
    layout: dict[str, Any] = {"height": inner_px + top_px + _BOTTOM_PX, "margin.t": top_px, "margin.l": left_px}
    for k in range(count):
        row, column = divmod(k, columns)
        suffix = "" if k == 0 else str(k + 1)
        left, top = column * (width + gap), 1 - row * (row_px + _TITLE_PX + _TICKS_PX) / inner_px
        layout[f"xaxis{suffix}.domain"] = [round(left, 5), round(min(left + width, 1.0), 5)]
        layout[f"yaxis{suffix}.domain"] = [round(max(top - row_px / inner_px, 0.0), 5), round(top, 5)]
    return layout
