"""Takes steps: Gauss-Newton on the cost's quadratic, quasi-Newton (L-BFGS) on top of it.

Gauss-Newton leaves out second derivatives of the residuals. Along a few nearly flat directions these are as large as
what it retains: there its steps are repeatedly up to twice too long, or half as long as they should be. A pair of a
step and of the change of the gradient along it corrects the quadratic in that direction (Liu and Nocedal 1989, Math
Program 45:503), and a gradient takes a tenth of the time of a new quadratic.

A precision that is negative nearly cancels the information of the data for which it was made: with slightly different
data, errors would grow without limit. So the Gaussian is updated when the information has changed, too, and not only
when the errors have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy.linalg

from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, GaussianPrior
from kinertia.estimation.simultaneous.search.problem import Linearised, MapProblem, Point
from kinertia.estimation.simultaneous.terms.model_terms import Displaced

_MOST_PAIRS = 16
_LEAST_CURVATURE = 0.02
"""Share of the expected curvature along a step; pairs with less are discarded."""
_ALIKE_SD = 0.02
"""The instruments' Gaussian is updated when their mean has moved by more, in standard deviations of all of them
together, ..."""
_ALIKE_SHARE = 0.3
"""... and by more than this share of the distance of all unknowns from the optimum."""
_ALIKE_INFORMATION = 0.1
"""It is also updated when the information on any combination of them has changed by more than this share."""


@dataclass(frozen=True, eq=False)
class GaussNewton:
    """Information on all unknowns at a point, eliminated from motions to displacements to what does not move.

    Attributes:
        problem: of the estimate.
        here: the point.
        displaced: per trial its information on the static unknowns, displacements eliminated.
        rest: (S, S) information on the static unknowns, all else eliminated, without the instruments' priors.
        static: the same, eliminated to the unknowns in the root equations; with the instruments' priors.
    """

    problem: MapProblem
    here: Linearised
    displaced: tuple[Displaced, ...]
    rest: StaticInformation
    static: StaticInformation

    @classmethod
    def of(cls, problem: MapProblem, here: Linearised, damping: np.ndarray | float = 0.0) -> Self:
        """Build it at a point, with the diagonal of the information on the static unknowns raised by `damping` (S,)."""
        places, information = problem.layout.displaced, here.information.copy()
        trials = zip(here.trials, problem.displaced_sd, strict=True)
        displaced = tuple(Displaced.of(trial.information, places, sd) for trial, sd in trials)
        for eliminated in displaced:
            information += eliminated.information
        information[np.diag_indices_from(information)] += damping
        rest = StaticInformation.of(information, problem.layout.in_root.stop)
        return cls(problem, here, displaced, rest, rest)

    def under(self, instruments: GaussianPrior) -> Self:
        """Return the quadratic with this Gaussian for the instruments."""
        places, first = self.problem.layout.errors, self.rest.first.copy()
        first[places, places] += instruments.precision
        return replace(self, static=replace(self.rest, first=first))

    def step(self, rhs: np.ndarray) -> np.ndarray:
        """Solve for the step of all unknowns; it and the right-hand side are ordered as in `Point.vector`."""
        pull = self.here.point.like(rhs)
        static, solved, rests = pull.static.copy(), [], []
        places, sds = self.problem.layout.displaced, self.problem.displaced_sd
        for k, (trial, displaced) in enumerate(zip(self.here.trials, self.displaced, strict=True)):
            forward, lost = trial.forward(pull.coefficients[k])
            offset_pull = pull.displaced[k] - sds[k] * lost[places]
            static -= lost + offset_pull @ displaced.gain
            solved.append(forward)
            rests.append(displaced.rest(offset_pull))
        step, motions, moved = self.static.solution(static), [], []
        for k, (trial, displaced) in enumerate(zip(self.here.trials, self.displaced, strict=True)):
            offset_pull = rests[k] - displaced.gain @ step
            in_trial = step.copy()
            in_trial[places] += sds[k] * offset_pull
            motions.append(trial.motion_step(solved[k], in_trial))
            moved.append(offset_pull)
        return np.concatenate([*(motion.ravel() for motion in motions), step, *moved])

    def in_trial(self, k: int, steps: np.ndarray) -> np.ndarray:
        """Return steps (S, u) of the static unknowns as they are in trial k, with its displacements following."""
        result, places = steps.copy(), self.problem.layout.displaced
        result[places] -= self.problem.displaced_sd[k][:, None] * (self.displaced[k].gain @ steps)
        return result

    def of_instruments(self, point: Point, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return posterior mean (k,) and covariance (k, k) of the instruments, given the step to the optimum."""
        return (point.static + point.like(step).static)[self.problem.layout.errors], self._covariance_of_instruments

    @cached_property
    def _covariance_of_instruments(self) -> np.ndarray:
        return self.static.covariance_of(self.problem.layout.errors)


@dataclass(frozen=True, eq=False)
class MotionAlone:
    """The Gauss-Newton quadratic of the motions alone, with everything that does not move fixed.

    Attributes:
        here: the point where it is built, without information on anything else.
    """

    here: Linearised

    def under(self, instruments: GaussianPrior) -> Self:
        """Return it unchanged: the instruments' Gaussian does not concern the motion."""
        return self

    def step(self, rhs: np.ndarray) -> np.ndarray:
        """Solve for the step of the motions alone; the steps of all other unknowns are zero."""
        pull = self.here.point.like(rhs)
        trials = zip(self.here.trials, pull.coefficients, strict=True)
        motions = [trial.motion_step(trial.forward(trial_pull)[0], np.zeros(0)).ravel() for trial, trial_pull in trials]
        return np.concatenate([*motions, np.zeros(len(rhs) - sum(motion.size for motion in motions))])


@dataclass(frozen=True, eq=False)
class SecantPairs:
    """Pairs of steps taken (n,) and of the decrease of the gradient along each (n,).

    >>> pairs = SecantPairs().with_pair(np.array([1.0, 0.0]), np.array([2.0, 0.0]), expected=1.0)
    >>> pairs.step(np.array([4.0, 3.0]), lambda rhs: rhs)
    array([2., 3.])
    """

    steps: tuple[np.ndarray, ...] = ()
    changes: tuple[np.ndarray, ...] = ()

    def with_pair(self, step: np.ndarray, change: np.ndarray, expected: float) -> SecantPairs:
        """Append a pair, in place of the oldest of many, if the step shows a fair share of the expected curvature."""
        if not step @ change > _LEAST_CURVATURE * expected:
            return self
        return SecantPairs((*self.steps, step)[-_MOST_PAIRS:], (*self.changes, change)[-_MOST_PAIRS:])

    def stiffer(self, places: slice, more: np.ndarray) -> SecantPairs:
        """Return the pairs after the cost has gained this information (m, m) on some of the unknowns."""
        changes = tuple(change.copy() for change in self.changes)
        for step, change in zip(self.steps, changes, strict=True):
            change[places] += step[places] @ more
        return SecantPairs(self.steps, changes)

    def step(self, rhs: np.ndarray, known: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Compute the step (n,) for a right-hand side, given `known`, which computes it without these pairs."""
        pairs = [(step, change, 1.0 / (step @ change)) for step, change in zip(self.steps, self.changes, strict=True)]
        left, shares = rhs.copy(), []
        for step, change, inverse in reversed(pairs):
            shares.append(inverse * (step @ left))
            left -= shares[-1] * change
        result = known(left)
        for (step, change, inverse), share in zip(pairs, reversed(shares), strict=True):
            result += (share - inverse * (change @ result)) * step
        return result


@dataclass(frozen=True, eq=False)
class AdaptedPrior:
    """The instruments' Gaussian, with the posterior that it gave them when it was made: mean (k,), information (k, k).

    Where it was not made with the same data, the mean is infinite.
    """

    gaussian: GaussianPrior
    mean: np.ndarray
    information: np.ndarray

    @classmethod
    def at_first(cls, priors: ErrorPriors) -> AdaptedPrior:
        """Return the Gaussian of the priors, before any data."""
        return cls.elsewhere(GaussianPrior.of(priors))

    @classmethod
    def elsewhere(cls, gaussian: GaussianPrior) -> AdaptedPrior:
        """Return a Gaussian that was made without the data, or with others."""
        return cls(gaussian, np.full(len(gaussian.pull), np.inf), gaussian.precision)

    def again(self, priors: ErrorPriors, mean: np.ndarray, covariance: np.ndarray, far: float) -> AdaptedPrior:
        """Update the Gaussian from the posterior mean and covariance under the present one.

        It is unchanged if the mean has hardly moved compared with the distance `far` from the optimum, in half the
        square of standard deviations, and the information is about the same in all directions.
        """
        information = np.linalg.inv(covariance)
        if np.isfinite(self.mean).all() and self._is_alike(mean, information, far):
            return self
        data, rhs = information - self.gaussian.precision, information @ mean - self.gaussian.pull
        gaussian = GaussianPrior.given(priors, data, rhs)
        information = data + gaussian.precision
        return AdaptedPrior(gaussian, np.linalg.solve(information, rhs + gaussian.pull), information)

    def _is_alike(self, mean: np.ndarray, information: np.ndarray, far: float) -> bool:
        away = mean - self.mean
        if away @ self.information @ away > max(_ALIKE_SD**2, _ALIKE_SHARE**2 * 2.0 * far):
            return False
        change = np.abs(scipy.linalg.eigvalsh(information - self.information, self.information)).max()
        return bool(change < _ALIKE_INFORMATION)
