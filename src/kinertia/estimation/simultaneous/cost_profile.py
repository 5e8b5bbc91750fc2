"""Integrates the posterior of a trial's delay over the profile of the cost: all else at its best for each delay.

One linearisation says too much of the delay: how forces change over milliseconds goes with motion and body, and the
second derivatives that Gauss and Newton leave out make the profile wider than they expect, by a fifth to a quarter in
walks. What is likelier, forces on time or off, depends on it exponentially. The profile is therefore taken at three
delays, and its parabola joined with the priors of the clock and of the trial's own delay, each with two components.
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
"""Information that holds the delay where the profile is taken, over what is known of it."""


@dataclass(frozen=True, eq=False)
class CostProfile:
    """An estimate with the delay's posterior from its profile; of several trials as it was.

    Attributes:
        here: the quadratic, with as much information on the delay as the profile has.
        instruments: the Gaussian that gives clock and delay their means and deviations.
        static: (S,) the unknowns, the others following these.
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
    ) -> CostProfile:
        """From where a search has ended.

        Args:
            problem: of the estimate.
            here: the last quadratic.
            instruments: the Gaussian in place of the instruments' priors.
            point: the end.
            search: the optimum with this quadratic and another Gaussian.
        """
        late, first = np.array(problem.profiled(), dtype=int), problem.layout.errors.start
        priors = [problem.layout.error_priors.own[k] for k in late - first]
        unchanged = cls(here, instruments, point.static)
        if not len(late):
            return unchanged
        model = GaussNewton.of(problem, here)
        root = model.under(instruments).static.root_of_covariance()
        across, own, values = root @ root[late].T, late - first, point.static[late]
        known = np.linalg.inv(across[late])
        sd = float(np.sqrt(across[late].sum()))
        delays = np.array([-sd, 0.0, sd])
        held = [_held(instruments, own, values + away / len(own), _HELD / sd**2) for away in delays]
        costs = [_cost(problem, search(model, each), instruments, own) for each in held]
        curve, slope, _ = np.polyfit(delays, costs, 2)
        if not curve > 0.0:
            return unchanged
        shown = np.full((len(own), len(own)), 2.0 * curve)
        right = np.full(len(own), 2.0 * curve * values.sum() - slope)
        gaussian = GaussianPrior.given(ErrorPriors(tuple(priors)), shown, right)
        found = np.linalg.solve(shown + gaussian.precision, right + gaussian.pull)
        linear = (known - instruments.precision[np.ix_(own, own)]).mean()
        information = here.information.copy()
        information[np.ix_(late, late)] += shown - linear
        return cls(
            replace(here, information=information),
            _with(instruments, own, gaussian.precision, gaussian.pull),
            point.static + across @ known @ (found - values),
        )


def _cost(problem: MapProblem, there: Point, instruments: GaussianPrior, own: np.ndarray) -> float:
    """Of everything but what the Gaussian says of some quantities alone."""
    values = there.static[problem.layout.errors]
    nothing = GaussianPrior(np.zeros_like(instruments.precision), np.zeros_like(instruments.pull))
    alone = _with(nothing, own, instruments.precision[np.ix_(own, own)], instruments.pull[own])
    return problem.slope(there).cost + instruments.cost(values) - alone.cost(values)


def _held(gaussian: GaussianPrior, own: np.ndarray, values: np.ndarray, information: float) -> GaussianPrior:
    """The same with some of the quantities held at these values by this much information on each."""
    return _with(gaussian, own, information * np.eye(len(own)), information * values)


def _with(gaussian: GaussianPrior, own: np.ndarray, precision: np.ndarray, pull: np.ndarray) -> GaussianPrior:
    """The same with this for some of the quantities alone."""
    every, pulls = gaussian.precision.copy(), gaussian.pull.copy()
    every[np.ix_(own, own)], pulls[own] = precision, pull
    return GaussianPrior(every, pulls)
