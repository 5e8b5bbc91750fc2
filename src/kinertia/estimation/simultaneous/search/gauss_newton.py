"""Builds the Gauss-Newton quadratic of the cost at one point, and solves it for steps."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.static_information import StaticInformation
from kinertia.estimation.simultaneous.markers.marker_offsets import Displaced
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.linearised import Linearised, Point
from kinertia.estimation.simultaneous.search.problem import MapProblem


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
    def of(cls, problem: MapProblem, here: Linearised, held: np.ndarray | float = 0.0) -> Self:
        """Build it at a point, with the diagonal of the information on the static unknowns raised by `held` (S,)."""
        places, information = problem.layout.displaced, here.information.copy()
        trials = zip(here.trials, problem.displaced_sd, strict=True)
        displaced = tuple(Displaced.of(trial.information, places, sd) for trial, sd in trials)
        for each in displaced:
            information += each.information
        information[np.diag_indices_from(information)] += held
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
            own = pull.displaced[k] - sds[k] * lost[places]
            static -= lost + own @ displaced.gain
            solved.append(forward)
            rests.append(displaced.rest(own))
        step, motions, moved = self.static.solution(static), [], []
        for k, (trial, displaced) in enumerate(zip(self.here.trials, self.displaced, strict=True)):
            own = rests[k] - displaced.gain @ step
            in_trial = step.copy()
            in_trial[places] += sds[k] * own
            motions.append(trial.motion_step(solved[k], in_trial))
            moved.append(own)
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
        motions = [trial.motion_step(trial.forward(own)[0], np.zeros(0)).ravel() for trial, own in trials]
        return np.concatenate([*motions, np.zeros(len(rhs) - sum(motion.size for motion in motions))])
