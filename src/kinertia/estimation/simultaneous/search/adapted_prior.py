"""Adapts the Gaussian that replaces the instruments' priors to the data, whenever these have changed enough.

A precision that is negative nearly cancels the information of the data for which it was made: with slightly different
data, errors would grow without limit. So the Gaussian is updated when the information has changed, too, and not only
when the errors have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, GaussianPrior

_ALIKE_SD = 0.02
"""The instruments' Gaussian is updated when their mean has moved by more, in standard deviations of all of them
together, ..."""
_ALIKE_SHARE = 0.3
"""... and by more than this share of the distance of all unknowns from the optimum."""
_ALIKE_INFORMATION = 0.1
"""It is also updated when the information on any combination of them has changed by more than this share."""


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
