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
from itertools import combinations, pairwise
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
        ways = _Ways.of(tuple(priors))
        spread, log_size = ways.posteriors(data)
        centres = spread @ right
        weight = ways.log_chance + 0.5 * (centres @ right + log_size - ways.log_variance)
        weight = np.exp(weight - weight.max())
        weight /= weight.sum()
        middle = weight @ centres
        apart = centres - middle
        whole = np.tensordot(weight, spread, 1) + (weight * apart.T) @ apart
        information = np.linalg.inv(whole)
        return GaussianPrior(information - data, information @ middle - right)


@dataclass(frozen=True, eq=False)
class _Ways:
    """The likeliest n ways for k instruments to be sound or faulty: all, or those of few faults.

    Attributes:
        sound, faulty: (k,) variances of either component.
        before, fault: (n,) the way with the same faults but one, and the instrument of that one; all sound comes first.
        begins: where the ways with one fault, with two, ... begin, and where the last end.
        log_chance, log_variance: (n,) logarithms of the chance, and of the product of the variances.
    """

    sound: np.ndarray
    faulty: np.ndarray
    before: np.ndarray
    fault: np.ndarray
    begins: tuple[int, ...]
    log_chance: np.ndarray
    log_variance: np.ndarray

    @classmethod
    @cache
    def of(cls, priors: tuple[SoundOrFaulty, ...]) -> _Ways:
        """Of these priors."""
        uncertain = [i for i, prior in enumerate(priors) if prior.faulty_share > 0.0]
        places: dict[tuple[int, ...], int] = {(): 0}
        begins = [1]
        for faults in range(1, len(uncertain) + 1):
            if len(places) + comb(len(uncertain), faults) > _MOST_COMPONENTS:
                break
            for own in combinations(uncertain, faults):
                places[own] = len(places)
            begins.append(len(places))
        off = np.zeros((len(places), len(priors)), dtype=bool)
        for own, row in places.items():
            off[row, list(own)] = True
        sound, faulty, share = (
            np.array([getattr(prior, name) for prior in priors]) for name in ("sound_sd", "faulty_sd", "faulty_share")
        )
        sound, faulty = np.square(sound), np.square(faulty)
        return cls(
            sound,
            faulty,
            np.array([places[own[:-1]] for own in places]),
            np.array([own[-1] if own else -1 for own in places]),
            tuple(begins),
            np.log(np.where(off, share, 1.0 - share).prod(axis=1)),
            np.log(np.where(off, faulty, sound)).sum(axis=1),
        )

    def posteriors(self, data: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, k, k) covariance of every way after data with this information (k, k), and the logarithms of their
        determinants; one fault more is a change of rank one (Sherman and Morrison).
        """
        n, k = len(self.before), len(data)
        spread, log_size = np.empty((n, k, k)), np.empty(n)
        information = data + np.diag(1.0 / self.sound)
        spread[0], log_size[0] = np.linalg.inv(information), -np.linalg.slogdet(information)[1]
        change = 1.0 / self.faulty - 1.0 / self.sound
        for own in (slice(*ends) for ends in pairwise(self.begins)):
            before, fault = self.before[own], self.fault[own]
            column = spread[before, :, fault]
            left = 1.0 + change[fault] * column[np.arange(len(column)), fault]
            across = column[:, :, None] * column[:, None, :]
            spread[own] = spread[before] - (change[fault] / left)[:, None, None] * across
            log_size[own] = log_size[before] - np.log(left)
        return spread, log_size
