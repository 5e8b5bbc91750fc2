"""Predicts the uncertainty of an estimate before it is made, from the trials at a given motion and body.

The information of the simultaneous estimate (`simultaneous`) depends on the data only through the point at which it is
evaluated. At the literature's parameters it predicts what a recording will determine; at the truth it is the Cramér-Rao
bound of the estimator's own noise model, prior included.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.linear_algebra.static_information import StaticInformation
from kinertia.estimation.simultaneous.markers.marker_offsets import as_displaced
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.model.log_cholesky import table_jacobian

_ROUNDS = 3
"""Iterations, each of which sets the instruments' priors to the posterior of the one before."""


@dataclass(frozen=True, eq=False)
class Information:
    """Information of several trials of a person, and of the prior, on parameters and calibration.

    Attributes:
        problem: the estimate at whose start it is evaluated: the observations' coordinates, the prior's mean. It holds
            each trial's own observations (`observation.Observations`): repeats are counted here.
        repeats: (t, t) how often the errors of each trial recur in each (`error_repetition.repeats`).
    """

    problem: MapProblem
    repeats: np.ndarray

    @cached_property
    def of_trials(self) -> tuple[np.ndarray, ...]:
        """Information (S, S) of each trial on the static unknowns, with the motion eliminated."""
        problem = self.problem
        trials = (problem.eliminated(k, start, problem.layout.start) for k, start in enumerate(problem.start))
        return tuple(trial.information for trial in trials)

    @cached_property
    def of_prior(self) -> np.ndarray:
        """Information (S, S) of all priors but the instruments'."""
        return self.problem.prior_information(self.problem.layout.start)

    def root(self, trials: Iterable[int]) -> np.ndarray:
        """Return R (10 s, S), where R R^T is the covariance of body segment parameters after these trials together."""
        chosen = list(trials)
        counts = self.repeats[np.ix_(chosen, chosen)].sum(axis=1)
        layout, information = self.problem.layout, self.of_prior.copy()
        for k, count in zip(chosen, counts, strict=True):
            sd = self.problem.displaced_sd[k]
            information = information + as_displaced(self.of_trials[k] / count, layout.displaced, sd)
        first = layout.in_root
        information[first, first] += self._of_instruments(StaticInformation.of(information, first.stop).first)
        theta = layout[BSP]
        chain = block_diag(*table_jacobian(self.problem.layout.start[theta]))
        result: np.ndarray = chain @ StaticInformation.of(information, first.stop).root_of_covariance()[theta]
        return result

    def _of_instruments(self, rest: np.ndarray) -> np.ndarray:
        """Return the information (n, n) of instrument priors if data, with information `rest`, show them fault-free."""
        priors, places = self.problem.layout.error_priors, self.problem.layout.errors
        gaussian, result = GaussianPrior.of(priors), np.zeros_like(rest)
        for _ in range(_ROUNDS):
            result[places, places] = gaussian.precision
            covariance = np.linalg.inv(rest + result)[places, places]
            gaussian = gaussian.updated(priors, np.zeros(len(priors.own)), covariance)
        result[places, places] = gaussian.precision
        return result

    def sd(self, trials: Iterable[int]) -> np.ndarray:
        """Return standard deviations (s, 10) of the body segment parameters after these trials together."""
        result: np.ndarray = np.linalg.norm(self.root(trials), axis=1).reshape(-1, 10)
        return result
