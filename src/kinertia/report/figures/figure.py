"""Defines a figure as plain data: its colours and lines, and how panels and rows are laid out.

Reports do not load plotly for this: its objects check every value against a schema, which took a fifth of a fit's time;
here the tests check every figure once.

A report carries plotly's script, and unpacks it when it is opened, so that it stays one file that needs no network.

The page rearranges the panels for its width: `layout.meta.arrangements` holds the input of plotly's `relayout` for each
number of columns and for "print".
"""

import base64
import gzip
import html
import json
import math
import re
import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kinertia.errors import FileError
from kinertia.io.output_folder import write_then_rename
from kinertia.model.compiled import cache_folder

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
GREY, PALE, UNUSED = "#6B6B6B", "#C8C8C8", "#E9E9E9"
SIDES = {"r": ("right", BLUE), "l": ("left", VERMILION), "": ("", BLACK)}
"""Word and colour by the suffix of a coordinate's name; "" where it has no side."""
COMPARED = (BLACK, ORANGE, "#CC79A7", SKY, GREY, GREEN)
"""Colours of results that are compared: none is a side's."""
SIDE_COLOURS = {"r": (BLUE, "blue"), "l": (VERMILION, "vermilion")}
"""Colour of each side, and its name."""
STAGES = {
    "literature": {"color": GREY, "dash": "dot", "width": 1.5},
    "corrected": {"color": ORANGE, "dash": "dash", "width": 1.5},
    "estimate_full": {"color": SKY, "dash": "solid", "width": 1},
    "estimate": {"color": BLUE, "dash": "solid", "width": 2},
}
"""Line of each stage of the residuals."""
FONT = "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
_BEST, _BOTTOM_PX, _RIGHT_PX = 9, 44, 14
_LEGEND_ROW_PX, _LEGEND_PER_ROW = 27, {1: 1, 2: 2, 3: 4}
_TITLE_PX, _TICKS_PX, _NOMINAL_WIDTH_PX = 30, 40, 960
MOST_COLUMNS = 3
_PAPER_PX = 620
"""Rows of panels on a sheet of paper, below the table of strides, at the scale of the page's print style."""
_COMPACT_COLUMNS, _COMPACT_WIDTH_PX = {"1": 2, "2": 3, "3": 3, "print": 3}, {"1": 366, "2": 650}
"""Columns of compact panels, and the width of a figure for which they are meant, by the arrangement's name."""
_ROTATION = re.compile(r"\b(int|ext)ernal rotation\b")
_AXIS = {
    "zeroline": True,
    "zerolinecolor": PALE,
    "zerolinewidth": 1,
    "gridcolor": "#EFEFEF",
    "linecolor": GREY,
    "ticks": "outside",
    "ticklen": 3,
    "tickfont": {"size": 11},
    "automargin": False,
}
_COLOURS, _BARS = (GREY, BLUE, ORANGE, GREEN), (BLUE, SKY, PALE, VERMILION)
_SYMBOLS = ("circle-open", "circle", "diamond", "square")
_ROW_PX, _LEFT_PX, _LETTERS = 34, 150, 22


def faded(colour: str, opacity: float) -> str:
    """Convert the colour "#rrggbb" to "rgba(...)"."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def between(first: str, second: str, share: float) -> str:
    """Return the colour at this share (0 to 1) of the way from one "#rrggbb" to another."""
    parts = [[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in (first, second)]
    return "#" + "".join(f"{round(a + share * (b - a)):02X}" for a, b in zip(*parts, strict=True))


@dataclass(frozen=True)
class Figure:
    """Traces and layout, named and nested as in plotly's reference (https://plotly.com/javascript/reference).

    Attributes:
        data: traces; numbers may be lists, or the arrays that `compact` makes.
        layout: axes, shapes, annotations, height; `meta.alt` is the text alternative.
        frames: frames of an animation.
    """

    data: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any]
    frames: Sequence[Mapping[str, Any]] = ()

    @property
    def alt(self) -> str:
        """Description of the figure in words."""
        return str(self.layout["meta"]["alt"])

    def to_json(self) -> str:
        """Return traces and layout as JSON for plotly.js.

        Raises:
            ValueError: a number outside of arrays is not finite, which JSON cannot represent.
        """
        content = {"data": self.data, "layout": self.layout}
        return json.dumps(content, default=_typed_array, allow_nan=False, separators=(",", ":"))


def written(figure: Figure) -> dict[str, Any]:
    """Return a figure for the templates: its text alternative, and the compressed input of plotly.js."""
    ways = figure.layout["meta"].get("arrangements", {})
    height = ways.get(str(MOST_COLUMNS), figure.layout)["height"]
    return {"alt": figure.alt, "packed": packed(figure.to_json().encode()), "height": height}


def compact(values: np.ndarray) -> np.ndarray:
    """Convert to single precision, in which `Figure.to_json` writes arrays: half the size, beyond visible accuracy."""
    return np.asarray(values, dtype=np.float32)


def _typed_array(values: object) -> dict[str, str]:
    """Return plotly.js' form of a binary array, little-endian in base64; NaN, a gap in a curve, is allowed here."""
    known = {np.dtype(np.float32): "f4", np.dtype(np.uint8): "u1"}
    if not (isinstance(values, np.ndarray) and values.dtype in known and values.ndim == 1):
        raise TypeError(f"a figure holds lists and one-dimensional arrays of float32 or uint8, not {values!r}")
    name = known[values.dtype]
    return {"dtype": name, "bdata": base64.b64encode(values.astype(f"<{name}").tobytes()).decode("ascii")}


def script_path() -> Path:
    """Return the path of the script in the plotly package, which is not imported."""
    spec = find_spec("plotly")
    assert spec is not None, "plotly is a dependency"
    assert spec.origin is not None
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"


def packed_script() -> str:
    """Return the script, gzip in base64; compressed again only where another plotly was installed since."""
    state = (script := script_path()).stat()
    kept = cache_folder() / f"plotly-{state.st_size}-{state.st_mtime_ns}.txt"
    with suppress(OSError):
        return kept.read_text(encoding="ascii")
    text = packed(script.read_bytes(), _BEST)
    with suppress(OSError, FileError):  # where nothing can be kept, every report compresses it
        for older in kept.parent.glob("plotly-*.txt"):
            older.unlink()
        write_then_rename(kept, text)
    return text


def packed(text: bytes, level: int = 6) -> str:
    """Compress a text to gzip and base64, reproducibly, at a level from 1 (fast) to 9 (small)."""
    return base64.b64encode(gzip.compress(text, level, mtime=0)).decode("ascii")


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


@dataclass(frozen=True)
class _Room:
    """Sizes of panels, px: height, space on the left, above and below each, and width of the whole figure."""

    row_px: int
    left_px: int = 52
    title_px: int = _TITLE_PX
    ticks_px: int = _TICKS_PX
    width_px: int = _NOMINAL_WIDTH_PX


def small_multiples(
    panels: Sequence[Panel],
    alt: str,
    x: dict[str, Any],
    row_px: int = 170,
    left_px: int = 52,
    linked: bool = True,
    compact_px: int = 0,
) -> Figure:
    """Arrange panels of one kind as one figure.

    Args:
        panels: panels from left to right, then downwards.
        alt: text alternative of the figure.
        x: settings of the horizontal axes.
        row_px: height of a panel.
        left_px: room for the labels of a vertical axis.
        linked: whether all panels have the same horizontal range.
        compact_px: height of a panel on pages, where panels share labels and two are side by side on a phone; 0 for
            pages like other output.
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
        anchors = {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "align": "left", "font": {"size": 12}}
        titles.append({"text": f"<b>{plain(panel.title)}</b>", **place, **anchors})
    ways: dict[str, Any] = {
        str(c): _arrangement(len(panels), c, _Room(row_px, left_px), len(shown)) for c in range(1, MOST_COLUMNS + 1)
    }
    layout = {**base_layout(alt), **axes, "shapes": shapes, "annotations": titles}
    arranged = _arranged(layout, ways[str(MOST_COLUMNS)])
    if compact_px:
        ways = _compact(panels, x, compact_px, len(shown))
    else:
        rows = math.ceil(len(panels) / MOST_COLUMNS)
        on_paper_px = min(row_px, _PAPER_PX // rows - _TITLE_PX - _TICKS_PX)
        ways["print"] = _arrangement(len(panels), MOST_COLUMNS, _Room(max(on_paper_px, 80), left_px), len(shown))
    return Figure(data, {**arranged, "meta": {**layout["meta"], "arrangements": ways}})


def _compact(panels: Sequence[Panel], x: dict[str, Any], row_px: int, legend: int) -> dict[str, Any]:
    """Return arrangements of small panels, which share the labels of their horizontal axes.

    On a screen what follows the first comma or stands in brackets is on a second line of a title.
    """
    ways, count = {}, len(panels)
    for name, columns in _COMPACT_COLUMNS.items():
        paper = name == "print"
        title_px, width_px = (22, _NOMINAL_WIDTH_PX) if paper else (38, _COMPACT_WIDTH_PX.get(name, _NOMINAL_WIDTH_PX))
        way = _arrangement(count, columns, _Room(row_px, 38, title_px, 10, width_px), legend)
        for k, panel in enumerate(panels):
            suffix = "" if k == 0 else str(k + 1)
            lowest = k + min(columns, count) >= count
            way[f"xaxis{suffix}.showticklabels"] = lowest
            way[f"xaxis{suffix}.title.text"] = x["title"]["text"] if lowest else ""
            title = panel.title if width_px == _NOMINAL_WIDTH_PX else _ROTATION.sub(r"\1. rotation", panel.title)
            way[f"annotations[{k}].text"] = f"<b>{plain(title)}</b>" if paper else _on_two_lines(title)
        ways[name] = way
    return ways


def _on_two_lines(title: str) -> str:
    """Break a title before its direction or its unit: "Hip power", "generation + (W/kg)"."""
    comma, bracket = title.find(", "), title.find(" (")
    at = comma if 0 <= comma < bracket else bracket
    if at < 0:
        return f"<b>{plain(title)}</b>"
    return f'<b>{plain(title[:at])}</b><br><span style="font-size:11px">{plain(title[at:].lstrip(", "))}</span>'


def _arranged(layout: dict[str, Any], flat: dict[str, Any]) -> dict[str, Any]:
    """Apply the settings of an arrangement, whose names are paths such as "xaxis2.domain", to the layout."""
    result = dict(layout)
    for path, value in flat.items():
        name, _, inner = path.partition(".")
        result[name] = {**result[name], inner: value} if inner else value
    return result


def base_layout(alt: str) -> dict[str, Any]:
    """Return the common layout of figures: font, white ground, legend on top, text `alt`, and no notebook template."""
    return {
        "template": {},
        "font": {"family": FONT, "size": 12, "color": "#1A1A1A"},
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


def _arrangement(count: int, columns: int, room: _Room, legend: int) -> dict[str, Any]:
    """Return domains of all axes, top margin and height of the figure, for this many columns and legend entries.

    Fewer panels than columns fill the width.
    """
    legend_rows = math.ceil(legend / _LEGEND_PER_ROW[columns])
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    each_px = room.row_px + room.title_px + room.ticks_px
    inner_px = rows * each_px - room.title_px - room.ticks_px
    gap = (room.left_px + 6) / (room.width_px - room.left_px - _RIGHT_PX)
    width = (1 - (columns - 1) * gap) / columns
    top_px = room.title_px + _LEGEND_ROW_PX * legend_rows
    layout: dict[str, Any] = {"height": inner_px + top_px + _BOTTOM_PX, "margin.t": top_px, "margin.l": room.left_px}
    for k in range(count):
        row, column = divmod(k, columns)
        suffix = "" if k == 0 else str(k + 1)
        left, top = column * (width + gap), 1 - row * each_px / inner_px
        layout[f"xaxis{suffix}.domain"] = [round(left, 5), round(min(left + width, 1.0), 5)]
        layout[f"yaxis{suffix}.domain"] = [round(max(top - room.row_px / inner_px, 0.0), 5), round(top, 5)]
    return layout


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
