"""Computes the evidence for a recording against the same one read otherwise, as with reversed free moments.

The evidence is the chance of the data with everything unknown integrated out: motion, body and calibration by the
quadratic at the optimum (Laplace), instruments by their exact priors, sound or faulty in every combination. The lowest
cost alone would favour the reading that needs a faulty instrument, since that one's wide prior hardly costs anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.linearised import Slope
from kinertia.estimation.simultaneous.observed_trial import Observation
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior, log_chance

_WRONG_ODDS = 0.25
"""Of a wrong sign to a right one before anything is measured: of some ten laboratories, two had it wrong."""
_SURE = float(np.log(0.95 / 0.05))
"""Logarithm of the odds at which a sign counts as found: a chance of 95 %."""


class Evidence(NamedTuple):
    """Logarithms, but for a constant that all readings of the same trials have.

    Attributes:
        found: of the trials as they were estimated.
        otherwise: of the same trials read otherwise, by the same quadratic; None where none was asked for.
    """

    found: float
    otherwise: float | None

    @classmethod
    def of(cls, model: GaussNewton, gaussian: GaussianPrior, otherwise: Sequence[Observation]) -> Evidence:
        """Of the trials that a quadratic at the optimum is of, under the Gaussian in place of the instruments' priors,
        and of the same trials read otherwise.
        """
        problem = model.problem
        found = log_evidence(model.here.slope, model, gaussian)
        if not otherwise:
            return cls(found, None)
        other = problem.of(otherwise)
        return cls(found, log_evidence(other.slope(model.here.point), model, gaussian))


def log_evidence(slope: Slope, model: GaussNewton, gaussian: GaussianPrior) -> float:
    """Logarithm of the evidence of one reading.

    Args:
        slope: at a point near the optimum, of the reading.
        model: the quadratic there, under the Gaussian.
        gaussian: in place of the priors of the instruments.
    """
    cost, right = slope.under(gaussian)
    step = model.step(right)
    mean, covariance = model.of_instruments(slope.point, step)
    after = np.linalg.inv(covariance)
    data, pulled = after - gaussian.precision, after @ mean - gaussian.pull
    # lowest cost of all else, where the instruments are as they are at the optimum
    lowest = cost - 0.5 * float(right @ step) - gaussian.cost(mean)
    at_none = lowest - 0.5 * float(mean @ data @ mean) + float(pulled @ mean)
    return log_chance(model.problem.layout.error_priors, data, pulled) - at_none


@dataclass(frozen=True)
class FreeMomentSign:
    """What a person's trials say of the sign of the free moments.

    Attributes:
        log_odds: logarithm of how much likelier the trials are with the sign turned.
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
        """Whether it is wrong in the files."""
        return self._posterior > _SURE

    @property
    def open(self) -> bool:
        """Whether these trials leave it open."""
        return abs(self._posterior) <= _SURE
