"""Names the figures that `fit.plot` and `fit.figure` share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar, get_args

from kinertia.errors import KinertiaError
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

if TYPE_CHECKING:
    import plotly.graph_objects as go

T = TypeVar("T")


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
        fit, one = self.fit, self._trial(trial)
        return self._of_trial(one, moment_figure(one, fit.skeleton, fit.mass_kg, start=start_of(fit)))

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
        one = self._trial(trial)
        return self._of_trial(one, coordinate_figure(one, self.fit.skeleton))

    def residuals(self, trial: str | None = None) -> T:
        """Draw root residual force and moment over time, stage by stage."""
        one = self._trial(trial)
        return self._of_trial(one, residual_figure(one, start=start_of(self.fit)))

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
        one = self._trial(trial)
        noise = None if self.fit.posterior is None else self.fit.posterior.marker_noise[self.fit.trials.index(one)]
        return self._of_trial(one, marker_figure(one, () if noise is None else noise.drifting))

    def gaps(self, trial: str | None = None) -> T:
        """Draw when markers were not visible; a sentence where all always were."""
        one = self._trial(trial)
        nothing = sentence_figure(f"Every marker of {one.name} was seen in every frame: there are no gaps.")
        return self._of_trial(one, fit_gap_figure(one) or nothing)

    def skeleton(self, trial: str | None = None) -> T:
        """Draw the skeleton in motion, with markers, centres of mass and ground reactions."""
        one = self._trial(trial)
        return self._of_trial(one, skeleton_figure(self.fit, one))

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
