"""Declares the figures of a fit, for the modules that draw them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from kinertia.estimation.result.cycles import Kind

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


class FitPictures(Protocol):
    """Plotly figures of a fit; `Fit.figure` draws some of them for papers, by the same names.

    Figures over time show one trial: the first if no name is given.

    Raises:
        KinertiaError: no such trial, no strides or no posterior to draw from (the message suggests another figure).
    """

    def moments(self, trial: str | None = None) -> Figure:
        """Draw joint moments over the gait cycle, all trials; for a named trial, or without strides, over time."""

    def angles(self, trial: str | None = None) -> Figure:
        """Draw joint angles over the gait cycle, all trials; for a named trial, or without strides, over time."""

    def powers(self) -> Figure:
        """Draw joint powers over the gait cycle."""

    def forces(self) -> Figure:
        """Draw ground reactions over the gait cycle."""

    def cycles(self, kind: Kind = "moment", norms: str | Path | None = None) -> Figure:
        """Draw angles, moments, powers or ground reactions ("force") over the gait cycle, in front of norms.

        `norms` is a CSV file with mean and standard deviation of normal curves, which become grey bands.
        """

    def coordinates(self, trial: str | None = None) -> Figure:
        """Draw every coordinate over time, by inverse kinematics and as estimated."""

    def residuals(self, trial: str | None = None) -> Figure:
        """Draw root residual force and moment over time, for each stage."""

    def bsp(self) -> Figure:
        """Draw changes of body segment parameters in kg, mm and kg m2, with intervals if there are any."""

    def departures(self) -> Figure:
        """Draw changes of body segment parameters in prior SDs; not available after two-level."""

    def information(self) -> Figure:
        """Draw how much of each parameter's prior variance the data remove; not available after two-level."""

    def body(self, shown: Literal["mass", "information"] = "mass") -> Figure:
        """Draw the body, coloured by change of mass or by "information" on each segment (not after two-level)."""

    def markers(self, trial: str | None = None) -> Figure:
        """Draw the distance between every measured and modelled marker."""

    def gaps(self, trial: str | None = None) -> Figure:
        """Draw when markers were not visible; a sentence if there are no gaps."""

    def skeleton(self, trial: str | None = None) -> Figure:
        """Draw the skeleton in motion, with markers, centres of mass and ground reactions."""
