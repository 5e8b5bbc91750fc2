"""`fit.plot`: the report's figures one by one, as plotly objects for notebooks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kinertia.estimation.cycles import Kind
from kinertia.estimation.result import Fit, TrialFit
from kinertia.io.norms_file import read_norms
from kinertia.report.body_figure import Shown, body_figure
from kinertia.report.bsp_figures import change_figure, departure_figure, information_figure
from kinertia.report.cycle_figures import cycle_figure
from kinertia.report.extras import expect_plotly
from kinertia.report.figure import Figure
from kinertia.report.marker_figures import fit_gap_figure, marker_figure
from kinertia.report.skeleton_view import skeleton_figure
from kinertia.report.time_figures import coordinate_figure, moment_figure, residual_figure
from kinertia.report.wording import start_of

if TYPE_CHECKING:
    import plotly.graph_objects as go


def as_plotly(figure: Figure) -> go.Figure:
    """The figure as plotly's object, which checks every name and value of it; plotly is loaded when it is needed.

    Raises:
        KinertiaError: plotly is not installed.
    """
    expect_plotly()
    import plotly.graph_objects as go

    return go.Figure(figure.data, figure.layout, figure.frames)


def _plotly_if_any(figure: Figure | None) -> go.Figure | None:
    return None if figure is None else as_plotly(figure)


@dataclass(frozen=True, eq=False)
class FitPlots:
    """Plotly figures of a fit. Those of one trial take its name; left out, it is the first.

    Raises:
        KeyError: there is no trial of this name; names those there are.
    """

    fit: Fit

    def residuals(self, trial: str | None = None) -> go.Figure:
        """Root residual force and moment over time, stage by stage."""
        return as_plotly(residual_figure(self._trial(trial), start=start_of(self.fit)))

    def coordinates(self, trial: str | None = None) -> go.Figure:
        """Every coordinate by inverse kinematics and as estimated."""
        return as_plotly(coordinate_figure(self._trial(trial), self.fit.skeleton))

    def moments(self, trial: str | None = None) -> go.Figure:
        """Joint moments per body mass, before against estimate."""
        mass_kg, start = self.fit.mass_kg, start_of(self.fit)
        return as_plotly(moment_figure(self._trial(trial), self.fit.skeleton, mass_kg, start=start))

    def cycles(self, kind: Kind = "moment", norms: str | Path | None = None) -> go.Figure | None:
        """Angles, moments, powers or ground reactions ("force") over the gait cycle; None without strides.

        `norms` is a CSV file with mean and standard deviation of normal curves, which become grey bands.
        """
        return _plotly_if_any(cycle_figure(self.fit, kind, {} if norms is None else read_norms(norms)))

    def markers(self, trial: str | None = None) -> go.Figure:
        """Distance between every measured and modelled marker."""
        one = self._trial(trial)
        noise = None if self.fit.posterior is None else self.fit.posterior.marker_noise[self.fit.trials.index(one)]
        return as_plotly(marker_figure(one, () if noise is None else noise.wandering))

    def gaps(self, trial: str | None = None) -> go.Figure | None:
        """When markers were not seen; None where all always were."""
        return _plotly_if_any(fit_gap_figure(self._trial(trial)))

    def skeleton(self, trial: str | None = None) -> go.Figure:
        """The skeleton in motion, with markers, centres of mass and ground reactions."""
        return as_plotly(skeleton_figure(self.fit, self._trial(trial)))

    def body(self, shown: Shown = "mass") -> go.Figure | None:
        """The body, coloured by change of mass or by what the data say of it ("information"; None after two-level)."""
        return _plotly_if_any(body_figure(self.fit, shown))

    def bsp(self) -> go.Figure:
        """Changes of body segment parameters in kg, mm and kg m2, with intervals where there are any."""
        return as_plotly(change_figure(self.fit))

    def departures(self) -> go.Figure | None:
        """The same in prior SDs; None after two-level."""
        return _plotly_if_any(departure_figure(self.fit))

    def information(self) -> go.Figure | None:
        """What the data say about each parameter; None after two-level."""
        return _plotly_if_any(information_figure(self.fit))

    def _trial(self, name: str | None) -> TrialFit:
        trials = {trial.name: trial for trial in self.fit.trials}
        if name is not None and name not in trials:
            raise KeyError(f"no trial '{name}' in this fit; there are: {', '.join(trials)}")
        return self.fit.trials[0] if name is None else trials[name]
