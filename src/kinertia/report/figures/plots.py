"""Draws the figures of a fit: `fit.plot` by plotly, `fit.figure` as files for papers by matplotlib, an extra.

Figures for papers are two columns wide (180 mm), with 7-point text that stays text in SVG and PDF files.
"""

from __future__ import annotations

import html
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, get_args

import numpy as np

from kinertia.errors import FileError, KinertiaError, how_to_install
from kinertia.estimation.result.cycles import UNITS, Kind
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.trial_fit import TrialFit
from kinertia.io.norms_file import read_norms
from kinertia.report.figures.body_figure import Shown, body_figure
from kinertia.report.figures.bsp_figures import change_figure, departure_figure, information_figure
from kinertia.report.figures.cycle_figures import cycle_figure
from kinertia.report.figures.figure import Figure, plain, sentence_figure
from kinertia.report.figures.marker_figures import fit_gap_figure, marker_figure
from kinertia.report.figures.skeleton_view import skeleton_figure
from kinertia.report.figures.time_figures import coordinate_figure, moment_figure, residual_figure
from kinertia.report.wording import start_of
from kinertia.trial.sampled_data import runs

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing


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
T = TypeVar("T")


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


def as_plotly(figure: Figure) -> go.Figure:
    """Convert the figure to plotly's object, which checks every name and value; plotly is loaded only when needed."""
    from kinertia.report.figures.notebook_figure import NotebookFigure

    return NotebookFigure(figure.data, figure.layout, figure.frames)


@dataclass(frozen=True, eq=False)
class FitFigures(Generic[T]):
    """Figures of a fit, one method for each.

    Figures over time show one trial, by default the first. A figure that cannot be drawn raises a KinertiaError with
    the reason, and with a figure that can be drawn instead.

    Attributes:
        fit: the fit.
        drawn: converts a figure to what the methods return: an object of plotly's or of matplotlib's.
    """

    fit: Fit
    drawn: Callable[[Figure], T]

    def moments(self, trial: str | None = None) -> T:
        """Draw joint moments over the gait cycle; over time for a given trial, or without strides."""
        if trial is None and self._walked:
            return self.cycles("moment")
        fit, chosen = self.fit, self._trial(trial)
        return self._of_trial(chosen, moment_figure(chosen, fit.skeleton, fit.mass_kg, start=start_of(fit)))

    def angles(self, trial: str | None = None) -> T:
        """Draw joint angles over the gait cycle; over time for a given trial, or without strides."""
        return self.cycles("angle") if trial is None and self._walked else self.coordinates(trial)

    def powers(self) -> T:
        """Draw joint powers over the gait cycle."""
        return self.cycles("power")

    def forces(self) -> T:
        """Draw ground reactions over the gait cycle."""
        return self.cycles("force")

    def cycles(self, kind: Kind = "moment", norms: str | Path | None = None) -> T:
        """Draw angles, moments, powers or ground reactions ("force") over the gait cycle, in front of `norms`."""
        if kind not in UNITS:
            raise KinertiaError(f"there are no curves '{kind}' over the gait cycle; expected one of {', '.join(UNITS)}")
        figure = cycle_figure(self.fit, kind, {} if norms is None else read_norms(norms))
        if figure is None:
            raise KinertiaError(
                f"no trial of this fit has a stride that shows it, so no gait cycle can be drawn ({kind}); "
                "'moments', 'angles' and 'residuals' are drawn over time"
            )
        return self.drawn(figure)

    def coordinates(self, trial: str | None = None) -> T:
        """Draw every coordinate over time, by inverse kinematics and as estimated."""
        chosen = self._trial(trial)
        return self._of_trial(chosen, coordinate_figure(chosen, self.fit.skeleton))

    def residuals(self, trial: str | None = None) -> T:
        """Draw root residual force and moment over time, stage by stage."""
        chosen = self._trial(trial)
        return self._of_trial(chosen, residual_figure(chosen, start=start_of(self.fit)))

    def bsp(self) -> T:
        """Draw changes of body segment parameters in kg, mm and kg m2, with intervals where there are any."""
        return self.drawn(change_figure(self.fit))

    def departures(self) -> T:
        """Draw changes of body segment parameters in prior SDs."""
        return self._with_error_bars(departure_figure(self.fit), "'bsp' has the changes in kg, mm and kg m2")

    def information(self) -> T:
        """Draw how well the data inform each parameter."""
        return self._with_error_bars(information_figure(self.fit), "'bsp' has the changes in kg, mm and kg m2")

    def body(self, shown: Shown = "mass") -> T:
        """Draw the body, coloured by change of mass, or by how well the data inform each segment ("information")."""
        if shown not in get_args(Shown):
            raise KinertiaError(f"a body is not coloured by '{shown}'; expected one of {', '.join(get_args(Shown))}")
        return self._with_error_bars(body_figure(self.fit, shown), "body('mass') is coloured by change of mass")

    def markers(self, trial: str | None = None) -> T:
        """Draw the distance between every measured and modelled marker."""
        chosen = self._trial(trial)
        noise = None if self.fit.posterior is None else self.fit.posterior.marker_noise[self.fit.trials.index(chosen)]
        return self._of_trial(chosen, marker_figure(chosen, () if noise is None else noise.drifting))

    def gaps(self, trial: str | None = None) -> T:
        """Draw when markers were not visible; a sentence where all always were."""
        chosen = self._trial(trial)
        nothing = sentence_figure(f"Every marker of {chosen.name} was seen in every frame: there are no gaps.")
        return self._of_trial(chosen, fit_gap_figure(chosen) or nothing)

    def skeleton(self, trial: str | None = None) -> T:
        """Draw the skeleton in motion, with markers, centres of mass and ground reactions."""
        chosen = self._trial(trial)
        return self._of_trial(chosen, skeleton_figure(self.fit, chosen))

    @property
    def _walked(self) -> bool:
        return any(trial.strides for trial in self.fit.trials)

    def _trial(self, name: str | None) -> TrialFit:
        trials = {trial.name: trial for trial in self.fit.trials}
        if name is not None and name not in trials:
            raise KinertiaError(f"no trial '{name}' in this fit; there are: {', '.join(trials)}")
        return self.fit.trials[0] if name is None else trials[name]

    def _of_trial(self, trial: TrialFit, figure: Figure) -> T:
        """Return the figure with the name of its trial in `meta`."""
        meta = {**figure.layout["meta"], "trial": plain(trial.name)}
        return self.drawn(replace(figure, layout={**figure.layout, "meta": meta}))

    def _with_error_bars(self, figure: Figure | None, instead: str) -> T:
        if figure is None:
            raise KinertiaError(f"the two-level method gives no error bars, which this figure is drawn from; {instead}")
        return self.drawn(figure)
