"""The clock's posterior from the profile of the cost, with everything else at its best for each delay.

One linearisation says too much of the delay: how forces change over milliseconds goes with motion and body, and the
second derivatives that Gauss and Newton leave out make the profile wider than they expect, by a fifth to a quarter in
walks. What is likelier, forces on time or off, depends on it exponentially. The profile is therefore taken at three
delays, its parabola joined with the prior's two components, and the mean and deviation of that are the clock's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.linearised import Linearised, Point
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.sound_or_faulty import ErrorPriors, GaussianPrior

_HELD = 1e6
"""Information that holds the clock where the profile is taken, over what is known of it."""


@dataclass(frozen=True, eq=False)
class ClockProfile:
    """An estimate with the clock's posterior from its profile.

    Attributes:
        here: the quadratic, with as much information on the clock as the profile has.
        instruments: the Gaussian that gives the clock its mean and deviation.
        static: (S,) the unknowns, the others following the clock.
    """

    here: Linearised
    instruments: GaussianPrior
    static: np.ndarray

    @classmethod
    def of(
        cls,
        problem: MapProblem,
        here: Linearised,
        instruments: GaussianPrior,
        point: Point,
        search: Callable[[GaussNewton, GaussianPrior], Point],
    ) -> ClockProfile:
        """From where a search has ended.

        Args:
            problem: of the estimate.
            here: the last quadratic.
            instruments: the Gaussian in place of the instruments' priors.
            point: the end.
            search: the optimum with this quadratic and another Gaussian.
        """
        layout, prior = problem.layout, problem.instruments.own[problem.layout.clock - problem.layout.instruments.start]
        unchanged = cls(here, instruments, point.static)
        if not 0.0 < prior.faulty_share < 1.0:
            return unchanged
        model = GaussNewton.of(problem, here)
        root = model.under(instruments).static.root_of_covariance()
        gain = root @ root[layout.clock]
        variance, mean = gain[layout.clock], point.static[layout.clock]
        own, sd = layout.clock - layout.instruments.start, np.sqrt(variance)
        places, costs = [], []
        for at in (mean - sd, mean, mean + sd):
            held = _held(instruments, own, at, _HELD / variance)
            there = problem.slope(search(model, held))
            values = there.point.static[layout.instruments]
            places.append(values[own])
            costs.append(there.cost + instruments.cost(values) - _alone(instruments, own).cost(values))
        curve, slope, _ = np.polyfit(np.array(places) - mean, costs, 2)
        if not curve > 0.0:
            return unchanged
        information = 2.0 * curve
        site = GaussianPrior(np.zeros((1, 1)), np.zeros(1)).updated(
            ErrorPriors((prior,)), np.array([mean - slope / information]), np.array([[1.0 / information]])
        )
        precision, pull = float(site.precision[0, 0]), float(site.pull[0])
        total = information + precision
        moved = (information * mean - slope + pull) / total
        return cls(
            _with_information(here, layout.clock, information - (1.0 / variance - instruments.precision[own, own])),
            _with(instruments, own, precision, pull),
            point.static + gain * (moved - mean) / variance,
        )


def _held(gaussian: GaussianPrior, own: int, at: float, information: float) -> GaussianPrior:
    """The same with one of the quantities held at a value by this much information."""
    return _with(gaussian, own, information, information * at)


def _alone(gaussian: GaussianPrior, own: int) -> GaussianPrior:
    """What it says of one of the quantities alone."""
    nothing = GaussianPrior(np.zeros_like(gaussian.precision), np.zeros_like(gaussian.pull))
    return _with(nothing, own, gaussian.precision[own, own], gaussian.pull[own])


def _with(gaussian: GaussianPrior, own: int, precision: float, pull: float) -> GaussianPrior:
    """The same with this for one of the quantities alone."""
    every, pulls = gaussian.precision.copy(), gaussian.pull.copy()
    every[own, own], pulls[own] = precision, pull
    return GaussianPrior(every, pulls)


def _with_information(here: Linearised, place: int, more: float) -> Linearised:
    """A quadratic with more information on one of the static unknowns, or less."""
    information = here.information.copy()
    information[place, place] += more
    return replace(here, information=information)
