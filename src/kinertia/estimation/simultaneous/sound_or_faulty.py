"""Prior of an instrument that is sound most of the time, and far off when it is not.

A single Gaussian serves neither kind of laboratory. One wide enough for a plate that stands 20 mm off its recorded
place lets a sound one wander by as much as skin motion says, and the joint moments with it; and the error of one plate
is shared out among all. With two components sound instruments stay where they are, and the one that is off takes the
whole of its error.

Under such priors the posterior is a sum of Gaussians, one for each way to be sound or faulty. Its mean and covariance
change smoothly with the data. The estimate takes in place of the priors the one Gaussian that gives its posterior the
same mean and covariance (moment matching; Minka 2001, UAI 17:362, calls it assumed-density filtering).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from math import comb

import numpy as np

_MOST_COMPONENTS = 4096
"""Ways to be sound or faulty that are looked at: all of eleven or twelve instruments, few faults of more."""


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

    def least_told(self, sd: float) -> float:
        """The smallest error that data with this deviation make likelier to be of a faulty instrument than of a sound
        one; infinite where there is only one kind.

        >>> prior = SoundOrFaulty(0.1, 2.0, 0.05)
        >>> round(prior.least_told(0.3), 2), round(prior.least_told(1.6), 2)
        (0.99, 5.37)
        """
        if not 0.0 < self.faulty_share < 1.0:
            return float("inf")
        sound, faulty = (float(np.hypot(sd, own)) for own in (self.sound_sd, self.faulty_sd))
        odds = np.log((1.0 - self.faulty_share) / self.faulty_share * faulty / sound)
        return float(np.sqrt(2.0 * odds / (sound**-2 - faulty**-2)))

    def draw(self, rng: np.random.Generator) -> float:
        """One instrument's error."""
        faulty = rng.random() < self.faulty_share
        return float(rng.normal(0.0, self.faulty_sd if faulty else self.sound_sd))


@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """A joint Gaussian in place of the priors of k quantities.

    Attributes:
        precision: (k, k) inverse covariance. Where data leave both components likely it has negative directions: no
            Gaussian prior is as wide as two apart; with what the data say it is positive again.
        pull: (k,) precision times mean.
    """

    precision: np.ndarray
    pull: np.ndarray

    @classmethod
    def of(cls, priors: Sequence[SoundOrFaulty]) -> GaussianPrior:
        """Where the data have said nothing: mean and variance of each prior."""
        return cls(np.diag([prior.sd**-2.0 for prior in priors]), np.zeros(len(priors)))

    def cost(self, values: np.ndarray) -> float:
        """Half the squared departure of values (k,) from the mean over its covariance, but for a constant."""
        return float(0.5 * values @ self.precision @ values - self.pull @ values)

    def updated(self, priors: Sequence[SoundOrFaulty], mean: np.ndarray, covariance: np.ndarray) -> GaussianPrior:
        """The Gaussian that gives the posterior of these priors the mean and covariance that it has, given the
        posterior (k,), (k, k) that was found with the present one.
        """
        information = np.linalg.inv(covariance)
        data, right = information - self.precision, information @ mean - self.pull
        variances, chances = _components(tuple(priors))
        spread = np.linalg.inv(data + np.eye(len(priors)) / variances[:, None, :])
        centres = spread @ right
        weight = np.log(chances) + 0.5 * (
            centres @ right + np.linalg.slogdet(spread)[1] - np.log(variances).sum(axis=1)
        )
        weight = np.exp(weight - weight.max())
        weight /= weight.sum()
        middle = weight @ centres
        apart = centres - middle
        whole = np.einsum("s,sij->ij", weight, spread) + np.einsum("s,si,sj->ij", weight, apart, apart)
        information = np.linalg.inv(whole)
        return GaussianPrior(information - data, information @ middle - right)


@cache
def _components(priors: tuple[SoundOrFaulty, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Variances (n, k) and chances (n,) of the likeliest ways to be sound or faulty: all, or those of few faults."""
    uncertain = [i for i, prior in enumerate(priors) if prior.faulty_share > 0.0]
    off: list[np.ndarray] = []
    for faults in range(len(uncertain) + 1):
        count = comb(len(uncertain), faults)
        if sum(map(len, off)) + count > _MOST_COMPONENTS:
            break
        chosen = np.array(list(combinations(uncertain, faults)), dtype=int).reshape(count, faults)
        some = np.zeros((count, len(priors)), dtype=bool)
        np.put_along_axis(some, chosen, True, axis=1)
        off.append(some)
    every = np.concatenate(off)
    sound, faulty, share = (
        np.array([getattr(prior, name) for prior in priors]) for name in ("sound_sd", "faulty_sd", "faulty_share")
    )
    return np.square(np.where(every, faulty, sound)), np.where(every, share, 1.0 - share).prod(axis=1)
