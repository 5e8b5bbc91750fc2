"""Names the figures of a fit, for whoever draws them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from kinertia.estimation.cycles import Kind

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


class FitPictures(Protocol):
    """Plotly figures of a fit; `Fit.figure` draws those of them that are for papers by the same names.

    Those over time are of one trial; its name left out, of the first.

    Raises:
        KinertiaError: no such trial, no strides or error bars to draw from (says which figure there is in its place).
    """

    def moments(self, trial: str | None = None) -> Figure:
        """Joint moments over the gait cycle, all trials; of a trial that is named, or without strides, over time."""

    def angles(self, trial: str | None = None) -> Figure:
        """Joint angles over the gait cycle, all trials; of a trial that is named, or without strides, over time."""

    def powers(self) -> Figure:
        """Joint powers over the gait cycle."""

    def forces(self) -> Figure:
        """Ground reactions over the gait cycle."""

    def cycles(self, kind: Kind = "moment", norms: str | Path | None = None) -> Figure:
        """Angles, moments, powers or ground reactions ("force") over the gait cycle, in front of norms.

        `norms` is a CSV file with mean and standard deviation of normal curves, which become grey bands.
        """

    def coordinates(self, trial: str | None = None) -> Figure:
        """Every coordinate over time, by inverse kinematics and as estimated."""

    def residuals(self, trial: str | None = None) -> Figure:
        """Root residual force and moment over time, stage by stage."""

    def bsp(self) -> Figure:
        """Changes of body segment parameters in kg, mm and kg m2, with intervals where there are any."""

    def departures(self) -> Figure:
        """The same in prior SDs; not after two-level."""

    def information(self) -> Figure:
        """What the data say about each parameter; not after two-level."""

    def body(self, shown: Literal["mass", "information"] = "mass") -> Figure:
        """The body, coloured by change of mass or by what the data say of it ("information"; not after two-level)."""

    def markers(self, trial: str | None = None) -> Figure:
        """Distance between every measured and modelled marker."""

    def gaps(self, trial: str | None = None) -> Figure:
        """When markers were not seen; a sentence where all always were."""

    def skeleton(self, trial: str | None = None) -> Figure:
        """The skeleton in motion, with markers, centres of mass and ground reactions."""
