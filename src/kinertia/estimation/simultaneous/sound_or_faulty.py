"""Defines the prior of an instrument that is sound most of the time, and far off when it is not.

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
from functools import cached_property

import numpy as np

_MOST_WAYS = 1024
"""To be sound or faulty, that are looked at with as many faults: all of twelve instruments, the likeliest of more."""
_MOST_NUMBERS = 2**21
"""In the covariances of these ways: of a hundred instruments and more, fewer ways are looked at."""
_FEWEST_WAYS = 32
_AT_ONCE = 2**15
"""Of these numbers are changed: larger arrays of them would leave the processor's cache."""
_UNLIKELY = -15.0
"""Logarithm of a way's chance over that of the likeliest: where none with as many faults has more, the search ends."""


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


@dataclass(frozen=True)
class ErrorPriors:
    """Priors of k errors, each the sum of one of its own and of those that it has in common with others.

    Attributes:
        own: of each alone.
        common: of what several have in common, and which these are.

    >>> plate = SoundOrFaulty(0.001, 0.015, 0.2)
    >>> ErrorPriors((plate, plate), ((plate, (0, 1)),)).covariance.round(6)
    array([[9.2e-05, 4.6e-05],
           [4.6e-05, 9.2e-05]])
    """

    own: tuple[SoundOrFaulty, ...]
    common: tuple[tuple[SoundOrFaulty, tuple[int, ...]], ...] = ()

    @classmethod
    def joined(cls, every: Sequence[ErrorPriors]) -> ErrorPriors:
        """Of all these errors, one kind after another."""
        common, before = [], 0
        for each in every:
            common += [(prior, tuple(before + one for one in members)) for prior, members in each.common]
            before += len(each.own)
        return cls(tuple(prior for each in every for prior in each.own), tuple(common))

    @cached_property
    def parts(self) -> tuple[SoundOrFaulty, ...]:
        """Priors of all parts, which are independent: (k + c)."""
        return (*self.own, *(prior for prior, _ in self.common))

    @cached_property
    def of_parts(self) -> np.ndarray:
        """(k, k + c) from the parts to the errors."""
        shared = np.zeros((len(self.own), len(self.common)))
        for column, (_, members) in zip(shared.T, self.common, strict=True):
            column[list(members)] = 1.0
        return np.hstack([np.eye(len(self.own)), shared])

    @cached_property
    def covariance(self) -> np.ndarray:
        """(k, k) of the errors."""
        scaled = self.of_parts * [part.sd for part in self.parts]
        result: np.ndarray = scaled @ scaled.T
        return result


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
    def of(cls, priors: ErrorPriors) -> GaussianPrior:
        """Where the data have said nothing: mean and covariance of the priors."""
        return cls(np.linalg.inv(priors.covariance), np.zeros(len(priors.own)))

    def cost(self, values: np.ndarray) -> float:
        """Half the squared departure of values (k,) from the mean over its covariance, but for a constant."""
        return float(0.5 * values @ self.precision @ values - self.pull @ values)

    def updated(self, priors: ErrorPriors, mean: np.ndarray, covariance: np.ndarray) -> GaussianPrior:
        """The Gaussian that gives the posterior of these priors the mean and covariance that it has, given the
        posterior (k,), (k, k) that was found with the present one.
        """
        information = np.linalg.inv(covariance)
        return GaussianPrior.given(priors, information - self.precision, information @ mean - self.pull)

    @classmethod
    def given(cls, priors: ErrorPriors, data: np.ndarray, right: np.ndarray) -> GaussianPrior:
        """The same where data have this information (k, k) and right-hand side (k,)."""
        parts = priors.of_parts
        middle, whole = _posterior(priors.parts, parts.T @ data @ parts, parts.T @ right)
        middle, information = parts @ middle, np.linalg.inv(parts @ whole @ parts.T)
        return cls(information - data, information @ middle - right)


def _posterior(priors: Sequence[SoundOrFaulty], data: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,), (k, k) mean and covariance of the sum of Gaussians, each weighed by how likely its way to be sound or
    faulty is after data with this information (k, k) and right-hand side (k,).

    The likeliest ways with one fault more are searched among those that add one to the likeliest so far.
    """
    change, log_odds = _faults(priors)
    ways = _Ways.sound(priors, data, right)
    likeliest = float(ways.log_weight[0])
    weight, first, second = 0.0, np.zeros(len(right)), np.zeros_like(data)
    while len(ways.log_weight) and ways.log_weight.max() > likeliest + _UNLIKELY:
        now = max(likeliest, float(ways.log_weight.max()))
        before, own = np.exp(likeliest - now), np.exp(ways.log_weight - now)
        weight = before * weight + own.sum()
        first = before * first + own @ ways.centres
        second = before * second + np.tensordot(own, ways.spread, 1) + (own * ways.centres.T) @ ways.centres
        likeliest, ways = now, ways.one_fault_more(change, log_odds)
    middle = first / weight
    return middle, second / weight - np.outer(middle, middle)


def log_chance(priors: ErrorPriors, data: np.ndarray, right: np.ndarray) -> float:
    """Logarithm of the mean, under these priors, of the chance exp(right x - x data x / 2) that data with this
    information (k, k) and right-hand side (k,) give the errors x; but for a constant that the priors alone have.
    """
    parts = priors.of_parts
    data, right = parts.T @ data @ parts, parts.T @ right
    change, log_odds = _faults(priors.parts)
    ways = _Ways.sound(priors.parts, data, right)
    weights = [ways.log_weight]
    while len(ways.log_weight) and ways.log_weight.max() > max(map(np.max, weights)) + _UNLIKELY:
        ways = ways.one_fault_more(change, log_odds)
        weights += [ways.log_weight] if len(ways.log_weight) else []
    return float(np.logaddexp.reduce(np.concatenate(weights)))


def _faults(priors: Sequence[SoundOrFaulty]) -> tuple[np.ndarray, np.ndarray]:
    """(k,) what a fault of each quantity adds to its precision, and to the logarithm of a way's prior chance, with what
    the components' deviations take; no chance where there is only one component.
    """
    change = np.array([prior.faulty_sd**-2.0 - prior.sound_sd**-2.0 for prior in priors])
    share = np.array([prior.faulty_share for prior in priors])
    shorter = np.log([prior.sound_sd / prior.faulty_sd for prior in priors])
    with np.errstate(divide="ignore"):
        return change, np.log(share / (1.0 - share)) + shorter


@dataclass(frozen=True, eq=False)
class _Ways:
    """Ways for k instruments to be sound or faulty, n with the same number of faults, and the posterior of each.

    Attributes:
        off: (n, k) what is faulty.
        log_weight: (n,) logarithm of each way's chance, but for a constant that all have.
        centres, spread: (n, k), (n, k, k) mean and covariance of its Gaussian.
    """

    off: np.ndarray
    log_weight: np.ndarray
    centres: np.ndarray
    spread: np.ndarray

    @classmethod
    def sound(cls, priors: Sequence[SoundOrFaulty], data: np.ndarray, right: np.ndarray) -> _Ways:
        """The one without a fault."""
        spread = np.linalg.inv(data + np.diag([prior.sound_sd**-2.0 for prior in priors]))
        centre = spread @ right
        log_weight = 0.5 * (centre @ right + np.linalg.slogdet(spread)[1])
        return cls(np.zeros((1, len(right)), dtype=bool), np.array([log_weight]), centre[None], spread[None])

    def one_fault_more(self, change: np.ndarray, log_odds: np.ndarray) -> _Ways:
        """The likeliest that add a fault (`_faults`) to one of these: a change of rank one (Sherman and Morrison)."""
        k = len(change)
        left = np.where(self.off, 1.0, 1.0 + change * np.diagonal(self.spread, axis1=1, axis2=2))
        log_weight = self.log_weight[:, None] + log_odds
        log_weight -= 0.5 * (np.log(left) + change / left * np.square(self.centres))
        log_weight[self.off] = -np.inf
        before, fault = self._likeliest(log_weight, min(_MOST_WAYS, max(_FEWEST_WAYS, _MOST_NUMBERS // k**2)))
        column, share = self.spread[before, :, fault], (change / left)[before, fault][:, None]
        spread, scaled, each = self.spread[before], share * column, 1 + _AT_ONCE // k**2
        for some in (slice(first, first + each) for first in range(0, len(before), each)):
            spread[some] -= scaled[some, :, None] * column[some, None, :]
        return _Ways(
            self.off[before] | np.eye(k, dtype=bool)[fault],
            log_weight[before, fault],
            self.centres[before] - share * self.centres[before, fault][:, None] * column,
            spread,
        )

    def _likeliest(self, log_weight: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
        """(m,), (m,) the likeliest ways after one fault more, as the way before (n) and its fault (k), each way once:
        it is met as often as it has faults.
        """
        n, k = log_weight.shape
        met = min(most * (1 + int(self.off[0].sum())), n * k)
        order = np.argpartition(log_weight, n * k - met, axis=None)[n * k - met :]
        order = order[log_weight.ravel()[order] > log_weight.max() + _UNLIKELY]
        before, fault = np.divmod(order[np.argsort(-log_weight.ravel()[order])], k)
        words = _in_words(self.off)[before] | _in_words(np.eye(k, dtype=bool))[fault]
        same = np.lexsort(words.T)
        new = np.ones(len(same), dtype=bool)
        new[1:] = (words[same[1:]] != words[same[:-1]]).any(axis=1)
        once = np.sort(same[new])[:most]
        return before[once], fault[once]


def _in_words(off: np.ndarray) -> np.ndarray:
    """(n, w) the same (n, k) with 64 instruments in each number."""
    faulty = np.packbits(off, axis=1)
    words = np.zeros((len(off), -(-off.shape[1] // 64)), np.uint64)
    words.view(np.uint8)[:, : faulty.shape[1]] = faulty
    return words
