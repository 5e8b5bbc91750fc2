"""Compares the evidence for a recording with that of another interpretation of it (reversed free moments).

The evidence is the probability of the data with all unknowns integrated out: motion, body and calibration by the
quadratic at the optimum (Laplace), instruments by their exact priors, fault-free or faulty in every combination. The
lowest cost alone would favour the interpretation that needs a faulty instrument, since its wide prior hardly costs
anything.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior, log_chance
from kinertia.estimation.simultaneous.observed_trial import Observation
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.linearised import Slope

_WRONG_ODDS = 0.25
"""Prior odds of a wrong to a right sign: two of some ten laboratories had it wrong."""
_SURE = float(np.log(0.95 / 0.05))
"""Log odds at which a sign counts as established: a probability of 95 %."""


class Evidence(NamedTuple):
    """Logarithms of the evidence, up to a constant common to all interpretations of the same trials.

    Attributes:
        found: of the trials as they were estimated.
        otherwise: of the same trials interpreted differently, by the same quadratic; None if not requested.
    """

    found: float
    otherwise: float | None

    @classmethod
    def of(cls, model: GaussNewton, gaussian: GaussianPrior, otherwise: Sequence[Observation]) -> Self:
        """Compute the evidence of the trials of a quadratic at the optimum, as they are and interpreted differently.

        The Gaussian replaces the instruments' priors.
        """
        problem = model.problem
        found = log_evidence(model.here.slope, model, gaussian)
        if not otherwise:
            return cls(found, None)
        other = problem.of(otherwise)
        return cls(found, log_evidence(other.slope(model.here.point), model, gaussian))


def log_evidence(slope: Slope, model: GaussNewton, gaussian: GaussianPrior) -> float:
    """Compute the logarithm of the evidence of one interpretation.

    Args:
        slope: of this interpretation, at a point near the optimum.
        model: the quadratic there, under the Gaussian.
        gaussian: replaces the priors of the instruments.
    """
    cost, rhs = slope.under(gaussian)
    step = model.step(rhs)
    mean, covariance = model.of_instruments(slope.point, step)
    after = np.linalg.inv(covariance)
    data, pulled = after - gaussian.precision, after @ mean - gaussian.pull
    # lowest cost of all else, with the instruments as at the optimum
    lowest = cost - 0.5 * float(rhs @ step) - gaussian.cost(mean)
    at_none = lowest - 0.5 * float(mean @ data @ mean) + float(pulled @ mean)
    return log_chance(model.problem.layout.error_priors, data, pulled) - at_none


@dataclass(frozen=True)
class FreeMomentSign:
    """Evidence of a person's trials on the sign of the free moments.

    Attributes:
        log_odds: logarithm of how much likelier the trials are with the sign reversed.
        rms_nm: of the free moments, N m.

    >>> FreeMomentSign(59.0, 2.0).wrong, FreeMomentSign(1.0, 2.0).open, FreeMomentSign(-20.0, 2.0).open
    (True, True, False)
    """

    log_odds: float
    rms_nm: float

    @property
    def _posterior(self) -> float:
        return self.log_odds + float(np.log(_WRONG_ODDS))

    @property
    def wrong(self) -> bool:
        """Whether the sign is wrong in the files."""
        return self._posterior > _SURE

    @property
    def open(self) -> bool:
        """Whether these trials leave the sign undetermined."""
        return abs(self._posterior) <= _SURE
