"""Prior of an instrument that is sound most of the time, and far off when it is not.

A single Gaussian serves neither kind of laboratory. One wide enough for a plate that stands 20 mm off its recorded
place lets a sound one wander by as much as skin motion says, and the joint moments with it; and the error of one plate
is shared out among all. With two components sound instruments stay where they are, and the one that is off takes the
whole of its error.

The posterior mean and variance under such priors come from expectation propagation (Minka 2001, UAI 17:362): in turn
each instrument's prior is replaced by the Gaussian that, together with what the data and all other instruments say of
it, has the mean and variance that the two components have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_SWEEPS = 50
_DAMPING = 0.7
_STILL = 1e-6


@dataclass(frozen=True)
class SoundOrFaulty:
    """Prior of one quantity whose mean is zero: a narrow Gaussian, and with some probability a wide one.

    Attributes:
        sound_sd, faulty_sd: deviations of either component.
        faulty_share: how often an instrument is faulty, 0 to 1.

    >>> SoundOrFaulty(0.001, 0.015, 0.2).sd
    0.00676...
    """

    sound_sd: float
    faulty_sd: float
    faulty_share: float

    @classmethod
    def certain(cls, sd: float) -> SoundOrFaulty:
        """A plain Gaussian."""
        return cls(sd, sd, 0.0)

    @property
    def sd(self) -> float:
        """Deviation of both components together."""
        share = self.faulty_share
        return float(np.sqrt((1.0 - share) * self.sound_sd**2 + share * self.faulty_sd**2))

    def draw(self, rng: np.random.Generator) -> float:
        """One instrument's error."""
        faulty = rng.random() < self.faulty_share
        return float(rng.normal(0.0, self.faulty_sd if faulty else self.sound_sd))

    def moments(self, mean: float, variance: float) -> tuple[float, float]:
        """Mean and variance of the quantity when this Gaussian is what everything else says of it."""
        squares = np.square([self.sound_sd, self.faulty_sd])
        shares = np.array([1.0 - self.faulty_share, self.faulty_share])
        with np.errstate(divide="ignore"):
            weight = np.log(shares) - 0.5 * np.log(variance + squares) - 0.5 * mean**2 / (variance + squares)
        weight = np.exp(weight - weight.max())
        weight /= weight.sum()
        means, variances = mean * squares / (variance + squares), variance * squares / (variance + squares)
        middle = float(weight @ means)
        return middle, float(weight @ (variances + np.square(means)) - middle**2)


@dataclass(frozen=True, eq=False)
class GaussianPriors:
    """Independent Gaussians in place of the priors of k quantities.

    Attributes:
        precision: (k,) 1 / variance of each.
        pull: (k,) precision times mean.
    """

    precision: np.ndarray
    pull: np.ndarray

    @classmethod
    def of(cls, priors: Sequence[SoundOrFaulty]) -> GaussianPriors:
        """Where the data have said nothing: mean and variance of each prior."""
        return cls(np.array([prior.sd**-2.0 for prior in priors]), np.zeros(len(priors)))

    def cost(self, values: np.ndarray) -> float:
        """Half the sum of squared departures of values (k,) over their deviations."""
        return 0.5 * float(np.sum(np.square(self.precision * values - self.pull) / self.precision))

    def updated(self, priors: Sequence[SoundOrFaulty], mean: np.ndarray, covariance: np.ndarray) -> GaussianPriors:
        """The Gaussians that fit these priors, given a posterior (k,), (k, k) that was found with the present ones."""
        precision, pull = self.precision.copy(), self.pull.copy()
        information = np.linalg.inv(covariance)
        data, right = information - np.diag(precision), information @ mean - pull
        for _ in range(_SWEEPS):
            moved = 0.0
            for i, prior in enumerate(priors):
                spread = np.linalg.inv(data + np.diag(precision))
                centre = spread @ (right + pull)
                here, others = 1.0 / spread[i, i], 1.0 / spread[i, i] - precision[i]
                if others <= 1e-12 * here:
                    new_precision, new_pull = prior.sd**-2.0, 0.0
                else:
                    without = (centre[i] * here - pull[i]) / others
                    middle, variance = prior.moments(without, 1.0 / others)
                    # where both components are about as likely no Gaussian prior is wide enough; the mean is kept
                    new_precision = max(1.0 / variance - others, prior.faulty_sd**-2.0)
                    new_pull = middle * (others + new_precision) - without * others
                change = _DAMPING * (new_precision - precision[i])
                moved = max(moved, abs(change) / here)
                precision[i] += change
                pull[i] += _DAMPING * (new_pull - pull[i])
            if moved < _STILL:
                break
        return GaussianPriors(precision, pull)
