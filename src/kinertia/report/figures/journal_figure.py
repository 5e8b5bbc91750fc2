"""Draws `fit.figure`: the report's figures as files for papers, by matplotlib, of the extra `plots`.

They are two columns wide (180 mm), with 7-point text that stays text in SVG and PDF files.
"""

from __future__ import annotations

import html
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kinertia.errors import FileError, KinertiaError
from kinertia.estimation.result.fit import Fit
from kinertia.report.figures.figure import Figure
from kinertia.report.figures.plots import FitFigures
from kinertia.trial.sampled_data import runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing
from importlib.util import find_spec

from kinertia.errors import how_to_install

_COLUMNS = 3
_WIDTH_MM, _ROW_MM, _LEGEND_MM = 180.0, 42.0, 12.0
_MM_PER_INCH = 25.4
_POINTS_PER_PX = 0.5
"""Points per pixel of lines and marks: the report's are for screens, and a journal's panels are half as wide."""
_TITLE_LETTERS = 36
"""Letters of a title in a line, beyond which it would leave the panel."""
_MOST_BESIDE, _LEGEND_LETTERS, _HANDLE_LETTERS = 4, 145, 8
"""Limits of a row of the legend: entries, letters, and letters that the line before each is worth."""
_DOTS_PER_INCH = 600
_FORMATS = (".svg", ".pdf", ".eps", ".png", ".tif", ".tiff")
_DASHES = {"dot": ":", "dash": "--"}
_MARKERS = {"circle": "o", "diamond": "D", "square": "s"}
_STYLE: Any = {
    "font.size": 7,
    "axes.titlesize": 7,
    "axes.linewidth": 0.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "font.family": "sans-serif",
    "font.sans-serif": ["Arial", "Helvetica", "DejaVu Sans"],
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}
OF_TRIALS = ("moments", "angles", "coordinates", "residuals")
"""Figures that can be of one trial, over time."""
FOR_PAPERS = (*OF_TRIALS, "powers", "forces", "cycles", "bsp", "departures")
"""Figures of `fit.plot` that are small multiples; the others are interactive."""
HOW = how_to_install("plots")


def save_figure(fit: Fit, name: str, path: str | Path, trial: str | None = None) -> Path:
    """Draw a figure into a file, whose extension determines its format, and return the file.

    Raises:
        KinertiaError: no such figure or trial, nothing to draw it from, or matplotlib is not installed.
        FileError: the format is unknown, or the file cannot be written.
    """
    path = Path(path)
    if name not in FOR_PAPERS:
        raise KinertiaError(_no_figure(name))
    if trial is not None and name not in OF_TRIALS:
        raise KinertiaError(f"the figure '{name}' shows all trials; for one trial there are {', '.join(OF_TRIALS)}")
    if path.suffix.lower() not in _FORMATS:
        raise FileError(path, f"'{path.suffix}' is not a figure format; expected one of {', '.join(_FORMATS)}")
    expect_matplotlib()
    import matplotlib as mpl

    with mpl.rc_context(_STYLE):
        draw = getattr(FitFigures(fit, drawing), name)
        drawn = draw() if trial is None else draw(trial)
        try:
            drawn.savefig(path, dpi=_DOTS_PER_INCH)
        except OSError as error:
            raise FileError(path, f"cannot be written: {error.strerror or error}") from error
    return path


def _no_figure(name: str) -> str:
    papers = f"expected one of {', '.join(FOR_PAPERS)}"
    if not name.startswith("_") and hasattr(FitFigures, name):
        return f"the figure '{name}' exists on screen only: fit.plot.{name}(); in files, {papers}"
    return f"there is no figure '{name}'; {papers}"


def drawing(figure: Figure) -> Drawing:
    """Draw small multiples with matplotlib: a panel per pair of axes, in rows of three."""
    from matplotlib.figure import Figure as Drawing
    from matplotlib.font_manager import FontProperties

    suffixes = [name.removeprefix("xaxis") for name in figure.layout if name.startswith("xaxis")]
    rows = -(-len(suffixes) // _COLUMNS)
    inches = (_WIDTH_MM / _MM_PER_INCH, (rows * _ROW_MM + _LEGEND_MM) / _MM_PER_INCH)
    drawn = Drawing(figsize=inches, layout="constrained")
    cells = drawn.subplots(rows, _COLUMNS, squeeze=False).ravel()
    panels = dict(zip(suffixes, cells, strict=False))
    for cell in cells[len(suffixes) :]:
        cell.remove()
    for suffix, title in zip(suffixes, figure.layout["annotations"], strict=True):
        panels[suffix].set_title(_in_lines(_text(title["text"])), loc="left")
    lower: np.ndarray | None = None
    for trace in figure.data:
        x, y = _numbers(trace, "x"), _numbers(trace, "y")
        _draw(panels[trace["xaxis"][1:]], trace, x, y, lower)
        lower = y
    for shape in figure.layout["shapes"]:
        _mark(panels[shape["xref"][1:]], shape)
    for suffix, panel in panels.items():
        _finish(panel, figure.layout[f"xaxis{suffix}"], figure.layout[f"yaxis{suffix}"])
    handles, labels = _legend(list(panels.values()))
    beside = min(_MOST_BESIDE, _LEGEND_LETTERS // (_HANDLE_LETTERS + max(map(len, labels))))
    legend = drawn.legend(handles, labels, loc="outside upper left", ncols=beside, frameon=False)
    if trial := figure.layout["meta"].get("trial"):
        legend.set_title(f"Trial {_text(trial)}", prop=FontProperties(weight="bold"))
        legend.set_alignment("left")
    return drawn


def _numbers(trace: Mapping[str, Any], name: str) -> np.ndarray:
    """Return the numbers of a trace: a list, an array, or evenly spaced."""
    if name in trace:
        return np.asarray(trace[name], dtype=float)
    return np.asarray(trace[f"{name}0"] + trace[f"d{name}"] * np.arange(len(trace["y"])))


def _draw(panel: Axes, trace: Mapping[str, Any], x: np.ndarray, y: np.ndarray, lower: np.ndarray | None) -> None:
    label = _text(trace["name"]) if trace.get("showlegend") else None
    if trace.get("fill") == "toself":
        for k, part in enumerate(_parts(x, y)):
            panel.fill(*part, color=_colour(trace["fillcolor"]), linewidth=0, label=None if k else label)
    elif trace.get("fill") == "tonexty":
        assert lower is not None
        panel.fill_between(x, lower, y, color=_colour(trace["fillcolor"]), linewidth=0, label=label)
    elif trace["mode"] == "markers":
        marker = trace["marker"]
        colour, bars = _colour(marker["color"]), trace.get("error_x")
        if bars is not None:
            half, width = np.asarray(bars["array"], dtype=float), _POINTS_PER_PX * bars["thickness"]
            panel.errorbar(x, y, xerr=half, fmt="none", ecolor=_colour(bars["color"]), elinewidth=width)
        size = _POINTS_PER_PX * marker["size"]
        symbol = _MARKERS[marker.get("symbol", "circle")]
        panel.plot(x, y, symbol, color=colour, markersize=size, label=label)
    elif trace["line"]["width"]:
        line = trace["line"]
        width, dashes = _POINTS_PER_PX * line["width"], _DASHES.get(line.get("dash", ""), "-")
        panel.plot(x, y, dashes, color=_colour(line["color"]), linewidth=width, label=label)


def _parts(x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Separate outlines that have a gap between them."""
    return [(x[first : last + 1], y[first : last + 1]) for first, last in runs(np.isfinite(y))]


def _mark(panel: Axes, shape: Mapping[str, Any]) -> None:
    """Draw a vertical line, or a shaded span."""
    if shape["type"] == "rect":
        panel.axvspan(shape["x0"], shape["x1"], color=_colour(shape["fillcolor"]), linewidth=0, zorder=0)
    else:
        dashes = _DASHES.get(shape["line"].get("dash", ""), "-")
        panel.axvline(shape["x0"], color=_colour(shape["line"]["color"]), linestyle=dashes, linewidth=0.4)


def _finish(panel: Axes, x: Mapping[str, Any], y: Mapping[str, Any]) -> None:
    """Set ranges, ticks and the title below."""
    for axis, shown, limits in ((panel.xaxis, x, panel.set_xlim), (panel.yaxis, y, panel.set_ylim)):
        if "range" in shown:
            limits(*shown["range"])
        if "tickvals" in shown:
            axis.set_ticks(shown["tickvals"], labels=[_text(tick) for tick in shown.get("ticktext", shown["tickvals"])])
    if "title" in x:
        panel.set_xlabel(_text(x["title"]["text"]))
    zero = panel.axhline if "ticktext" not in y else panel.axvline
    zero(0, color="#C8C8C8", linewidth=0.4, zorder=0)


def _legend(panels: list[Axes]) -> tuple[list[Any], list[str]]:
    """Return each name once."""
    by_label: dict[str, Any] = {}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        by_label = {**dict(zip(labels, handles, strict=True)), **by_label}
    return list(by_label.values()), list(by_label)


def _in_lines(title: str) -> str:
    """Break a title where it would leave its panel, but not inside its unit."""
    whole = re.sub(r"\([^)]*\)", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), title)
    return textwrap.fill(whole, _TITLE_LETTERS).replace("\N{NO-BREAK SPACE}", " ")


def _text(marked: object) -> str:
    """Return what plotly would show of a text with markup; a dollar sign is escaped from mathematics."""
    return html.unescape(re.sub(r"<[^>]+>", "", str(marked))).replace("$", r"\$")


def _colour(written: str) -> Any:
    """Convert "rgba(0,114,178,0.25)" for matplotlib; "#0072B2" is unchanged."""
    if not written.startswith("rgba("):
        return written
    *rgb, opacity = (float(part) for part in written[5:-1].split(","))
    return (*(part / 255 for part in rgb), opacity)


def has_matplotlib() -> bool:
    """Return whether the studies' pictures and figures for papers can be drawn."""
    return find_spec("matplotlib") is not None


def expect_matplotlib() -> None:
    """Raise a KinertiaError, with how to install matplotlib, unless it is installed."""
    if not has_matplotlib():
        raise KinertiaError(f"figures in files need matplotlib, which is not installed: {HOW}")
