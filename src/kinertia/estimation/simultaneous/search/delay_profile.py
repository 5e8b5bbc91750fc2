"""Integrates the posterior of a delay over the profile of the cost; adds the variance of unknowns left out.

A single linearisation makes the delay too certain: changes of force over milliseconds are correlated with motion and
body, and the second derivatives that Gauss-Newton leaves out make the profile a fifth to a quarter wider in walks.
Whether delayed or synchronous forces are likelier depends on its width exponentially. The profile is therefore
evaluated at three delays, and its parabola combined with the priors of the synchronisation delay and of the trial's own
delay, each with two components.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, GaussianPrior
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import Linearised, Point, Slope

_FIXING = 1e6
"""Information that fixes the delay where the profile is evaluated, relative to what is known of it."""


@dataclass(frozen=True, eq=False)
class CostProfile:
    """An estimate with the delay's posterior from its profile; unchanged for several trials.

    Attributes:
        here: the quadratic, with the profile's information on the delay.
        instruments: the Gaussian with the means and standard deviations of synchronisation and trial delay.
        static: (S,) the unknowns, with the others adjusted to these.
    """

    here: Linearised
    instruments: GaussianPrior
    static: np.ndarray

    @classmethod
    def of(
        cls,
        model: GaussNewton,
        instruments: GaussianPrior,
        point: Point,
        search: Callable[[GaussNewton, Slope, GaussianPrior], tuple[np.ndarray, float]],
    ) -> Self:
        """Compute the profile from the point where a search has ended.

        Args:
            model: the last quadratic, under the Gaussian that replaces the instruments' priors.
            instruments: that Gaussian.
            point: end of the search.
            search: returns the static unknowns and the cost at the optimum with another Gaussian, from this quadratic
                and the gradient at the point.
        """
        problem, here = model.problem, model.here
        late, first = np.array(problem.profiled(), dtype=int), problem.layout.errors.start
        priors = [problem.layout.error_priors.own[k] for k in late - first]
        unchanged = cls(here, instruments, point.static)
        if not len(late):
            return unchanged
        root = model.static.root_of_covariance()
        across, own, values = root @ root[late].T, late - first, point.static[late]
        known = np.linalg.inv(across[late])
        sd = float(np.sqrt(across[late].sum()))
        delays = np.array([-sd, 0.0, sd])
        fixed = [_fixed(instruments, own, values + away / len(own), _FIXING / sd**2) for away in delays]
        slope = problem.slope(point)
        costs = [_without(each, own, *search(model, slope, each), first) for each in fixed]
        curve, slope, _ = np.polyfit(delays, costs, 2)
        if not curve > 0.0:
            return unchanged
        shown = np.full((len(own), len(own)), 2.0 * curve)
        rhs = np.full(len(own), 2.0 * curve * values.sum() - slope)
        gaussian = GaussianPrior.given(ErrorPriors(tuple(priors)), shown, rhs)
        found = np.linalg.solve(shown + gaussian.precision, rhs + gaussian.pull)
        linear = (known - instruments.precision[np.ix_(own, own)]).mean()
        information = here.information.copy()
        information[np.ix_(late, late)] += shown - linear
        return cls(
            replace(here, information=information),
            _with(instruments, own, gaussian.precision, gaussian.pull),
            point.static + across @ known @ (found - values),
        )


def _without(gaussian: GaussianPrior, own: np.ndarray, static: np.ndarray, cost: float, first: int) -> float:
    """Return a cost under a Gaussian without its prior of some quantities, which begin at `first` in `static` (S,)."""
    alone = GaussianPrior(gaussian.precision[np.ix_(own, own)], gaussian.pull[own])
    return cost - alone.cost(static[first + own])


def _fixed(gaussian: GaussianPrior, own: np.ndarray, values: np.ndarray, information: float) -> GaussianPrior:
    """Return the Gaussian with some quantities fixed at these values by this much information on each."""
    return _with(gaussian, own, information * np.eye(len(own)), information * values)


def _with(gaussian: GaussianPrior, own: np.ndarray, precision: np.ndarray, pull: np.ndarray) -> GaussianPrior:
    """Return the Gaussian with precision and pull of some quantities replaced."""
    every, pulls = gaussian.precision.copy(), gaussian.pull.copy()
    every[np.ix_(own, own)], pulls[own] = precision, pull
    return GaussianPrior(every, pulls)


def with_left_out(
    directions: np.ndarray, data: np.ndarray, pull: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the effect of u more unknowns of unit standard deviation that displace the others, as seen by the data.

    It returns (S,) how far the estimate moves back to the prior, and (S, u) a root of what is added to its covariance.

    Args:
        directions: (S, u) displacements of the unknowns.
        data: (S, u) information of the data on the unknowns, times these.
        pull: (u,) of the data along them, at the estimate without these unknowns.
        covariance: (S, S) without them.

    >>> one = np.ones((1, 1))
    >>> moved, root = with_left_out(one, 99.0 * one, np.array([1.98]), 0.01 * one)  # 1.98 +- 0.1, prior 0 +- 1
    >>> moved.round(2), (root @ root.T).round(2)
    (array([-0.99]), array([[0.49]]))
    """
    carried = covariance @ data
    left, along = np.linalg.eigh(np.eye(len(pull)) + directions.T @ data - data.T @ carried)
    # never below the prior's; rounding makes it so where other priors are next to exact
    root = carried @ (along / np.sqrt(np.maximum(left, 1.0)))
    return -root @ (along.T @ pull / np.sqrt(np.maximum(left, 1.0))), root
