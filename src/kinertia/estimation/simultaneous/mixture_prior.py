"""Defines the prior of an instrument that is accurate most of the time, and faulty otherwise.

A single Gaussian suits neither kind of laboratory. One that is wide enough for a plate displaced by 20 mm allows skin
motion to displace an accurate one as well, and to change the joint moments with it; and the error of one plate is
distributed over all. With two components accurate instruments stay unchanged, and the faulty one takes the whole of its
error.

Under such priors the posterior is a sum of Gaussians, one for each combination of fault-free and faulty instruments.
Its mean and covariance change smoothly with the data. In place of the priors, the estimate uses the one Gaussian that
gives its posterior the same mean and covariance (moment matching; Minka 2001, UAI 17:362, calls it assumed-density
filtering).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

_MOST_WAYS = 1024
"""Number of combinations considered with as many faults: all for twelve instruments, the likeliest for more."""
_MOST_NUMBERS = 2**21
"""Size of all covariances of these combinations: for a hundred instruments and more, fewer are considered."""
_FEWEST_WAYS = 32
_UNLIKELY = -15.0
"""Log probability relative to the likeliest combination: if none with as many faults exceeds it, the search ends."""


@dataclass(frozen=True)
class FaultMixture:
    """Prior of a quantity that is near zero: a narrow Gaussian and, with the fault probability, a wide one.

    Attributes:
        nominal_sd, faulty_sd: standard deviations of the components.
        fault_probability: fault probability, 0 to 1.
        faulty_mean: mean of the wide one; the narrow one's is zero.

    >>> FaultMixture(0.001, 0.015, 0.2).sd
    0.00676...
    """

    nominal_sd: float
    faulty_sd: float
    fault_probability: float
    faulty_mean: float = 0.0

    @classmethod
    def certain(cls, sd: float) -> FaultMixture:
        """Return a plain Gaussian."""
        return cls(sd, sd, 0.0)

    @property
    def sd(self) -> float:
        """Root mean square of both components together: their standard deviation from zero."""
        share = self.fault_probability
        faulty = self.faulty_sd**2 + self.faulty_mean**2
        return float(np.sqrt((1.0 - share) * self.nominal_sd**2 + share * faulty))

    def smallest_detectable(self, sd: float) -> float:
        """Return the smallest error that data with this standard deviation attribute to a fault with odds above one.

        It is infinite if there is only one component. Faults have zero mean here.

        >>> prior = FaultMixture(0.1, 2.0, 0.05)
        >>> round(prior.smallest_detectable(0.3), 2), round(prior.smallest_detectable(1.6), 2)
        (0.99, 5.37)
        """
        if not 0.0 < self.fault_probability < 1.0:
            return float("inf")
        sound, faulty = (float(np.hypot(sd, error_sd)) for error_sd in (self.nominal_sd, self.faulty_sd))
        odds = np.log((1.0 - self.fault_probability) / self.fault_probability * faulty / sound)
        return float(np.sqrt(2.0 * odds / (sound**-2 - faulty**-2)))

    def draw(self, rng: np.random.Generator) -> float:
        """Draw one instrument's error."""
        faulty = rng.random() < self.fault_probability
        return float(rng.normal(self.faulty_mean, self.faulty_sd) if faulty else rng.normal(0.0, self.nominal_sd))


@dataclass(frozen=True)
class ErrorPriors:
    """Priors of k errors, each the sum of a part of its own and of parts in common with others.

    Attributes:
        individual: prior of each one's own part.
        common: priors of common parts, each with the indices of the errors that share it.

    >>> plate = FaultMixture(0.001, 0.015, 0.2)
    >>> ErrorPriors((plate, plate), ((plate, (0, 1)),)).covariance.round(6)
    array([[9.2e-05, 4.6e-05],
           [4.6e-05, 9.2e-05]])
    """

    individual: tuple[FaultMixture, ...]
    common: tuple[tuple[FaultMixture, tuple[int, ...]], ...] = ()

    @classmethod
    def joined(cls, every: Sequence[ErrorPriors]) -> ErrorPriors:
        """Concatenate the priors of several kinds of errors."""
        common, before = [], 0
        for priors in every:
            common += [(prior, tuple(before + member for member in members)) for prior, members in priors.common]
            before += len(priors.individual)
        return cls(tuple(prior for priors in every for prior in priors.individual), tuple(common))

    @cached_property
    def parts(self) -> tuple[FaultMixture, ...]:
        """Priors of all parts, which are independent: (k + c)."""
        return (*self.individual, *(prior for prior, _ in self.common))

    @cached_property
    def of_parts(self) -> np.ndarray:
        """Matrix (k, k + c) from the parts to the errors."""
        shared = np.zeros((len(self.individual), len(self.common)))
        for column, (_, members) in zip(shared.T, self.common, strict=True):
            column[list(members)] = 1.0
        return np.hstack([np.eye(len(self.individual)), shared])

    @cached_property
    def covariance(self) -> np.ndarray:
        """Prior covariance (k, k) of the errors."""
        scaled = self.of_parts * [part.sd for part in self.parts]
        result: np.ndarray = scaled @ scaled.T
        return result


@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """Joint Gaussian that replaces the priors of k quantities.

    Attributes:
        precision: (k, k) inverse covariance. Where data leave both components likely it has negative directions, since
            no Gaussian prior is as wide as two separate ones; together with the data it is positive again.
        pull: (k,) precision times mean.
    """

    precision: np.ndarray
    pull: np.ndarray

    @classmethod
    def of(cls, priors: ErrorPriors) -> GaussianPrior:
        """Return mean and covariance of the priors, without data."""
        return cls(np.linalg.inv(priors.covariance), np.zeros(len(priors.individual)))

    def cost(self, values: np.ndarray) -> float:
        """Return half the squared distance of values (k,) from the mean over its covariance, up to a constant."""
        return float(0.5 * values @ self.precision @ values - self.pull @ values)

    def updated(self, priors: ErrorPriors, mean: np.ndarray, covariance: np.ndarray) -> GaussianPrior:
        """Return the Gaussian that gives the posterior its true mean and covariance under these priors.

        The arguments are the posterior mean (k,) and covariance (k, k) found with the present Gaussian.
        """
        information = np.linalg.inv(covariance)
        return GaussianPrior.given(priors, information - self.precision, information @ mean - self.pull)

    @classmethod
    def given(cls, priors: ErrorPriors, data: np.ndarray, rhs: np.ndarray) -> GaussianPrior:
        """Return that Gaussian for data with this information (k, k) and right-hand side (k,)."""
        parts = priors.of_parts
        middle, whole = _posterior(priors.parts, parts.T @ data @ parts, parts.T @ rhs)
        middle, information = parts @ middle, np.linalg.inv(parts @ whole @ parts.T)
        return cls(information - data, information @ middle - rhs)


def _posterior(priors: Sequence[FaultMixture], data: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (k,) and covariance (k, k) of the posterior, a sum of Gaussians.

    Each is weighted by the probability of its combination of faults after data with this information (k, k) and
    right-hand side (k,).
    """
    spread = _sound_spread(priors, data)
    every = _combinations(priors, spread, rhs)
    likeliest = max(float(ways.log_weight.max()) for ways in every)
    weight, middle, square = 0.0, np.zeros(len(rhs)), np.zeros_like(data)
    with_more = np.zeros(_MOST_WAYS)
    for ways in reversed(every):
        weights = np.exp(ways.log_weight - likeliest)
        with_more = with_more[: len(weights)] + weights
        weight += weights.sum()
        middle += weights @ ways.centres
        square += ways.squares(weights, with_more)
        with_more = np.bincount(ways.before, with_more, _MOST_WAYS).astype(float)
    middle /= weight
    return middle, spread + square / weight - np.outer(middle, middle)


def fault_probabilities(priors: ErrorPriors, data: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Return the probability (k,) that each error's own part is faulty, after data as in `log_chance`."""
    parts = priors.of_parts
    every = _combinations(priors.parts, _sound_spread(priors.parts, parts.T @ data @ parts), parts.T @ rhs)
    log_weight = np.concatenate([ways.log_weight for ways in every])
    weight = np.exp(log_weight - log_weight.max())
    off = np.concatenate([ways.off for ways in every])
    result: np.ndarray = (weight @ off / weight.sum())[: len(priors.individual)]
    return result


def log_chance(priors: ErrorPriors, data: np.ndarray, rhs: np.ndarray) -> float:
    """Return the log probability of data under these priors, up to a constant that depends on the priors alone.

    It is the logarithm of the mean of exp(right x - x data x / 2) over errors x, for data with this information (k, k)
    and right-hand side (k,).
    """
    parts = priors.of_parts
    every = _combinations(priors.parts, _sound_spread(priors.parts, parts.T @ data @ parts), parts.T @ rhs)
    return float(np.logaddexp.reduce(np.concatenate([ways.log_weight for ways in every])))


def _sound_spread(priors: Sequence[FaultMixture], data: np.ndarray) -> np.ndarray:
    """Return the posterior covariance (k, k) without a fault."""
    return np.linalg.inv(data + np.diag([prior.nominal_sd**-2.0 for prior in priors]))


def _combinations(priors: Sequence[FaultMixture], spread: np.ndarray, rhs: np.ndarray) -> list[_Ways]:
    """Return the combinations of faults worth considering, without a fault, with one, with two ...

    The likeliest with one fault more are searched among those that add one to the likeliest so far.
    """
    faults, every = _Faults.of(priors), [_Ways.sound(spread, rhs)]
    likeliest = float(every[0].log_weight[0])
    while len(every[-1].log_weight):
        likeliest = max(likeliest, float(every[-1].log_weight.max()))
        every.append(every[-1].one_fault_more(faults, spread, likeliest + _UNLIKELY))
    return every[:-1]


@dataclass(frozen=True, eq=False)
class _Faults:
    """Changes of a combination by a fault of each of k quantities.

    Attributes:
        precision, pull: (k,) changes of the prior's precision, and of precision times mean.
        log_odds: (k,) change of the log prior, with the ratio of the components' standard deviations; -inf if there is
            only one component.
    """

    precision: np.ndarray
    pull: np.ndarray
    log_odds: np.ndarray

    @classmethod
    def of(cls, priors: Sequence[FaultMixture]) -> _Faults:
        """Return the faults of quantities with these priors."""
        share, nominal, faulty, mean = np.array(
            [(prior.fault_probability, prior.nominal_sd, prior.faulty_sd, prior.faulty_mean) for prior in priors]
        ).T
        with np.errstate(divide="ignore"):
            log_odds = np.log(share / (1.0 - share)) + np.log(nominal / faulty) - 0.5 * np.square(mean / faulty)
        return cls(faulty**-2.0 - nominal**-2.0, mean * faulty**-2.0, log_odds)


@dataclass(frozen=True, eq=False)
class _Ways:
    """Combinations of faults among k instruments, n with the same number f of faults, and their posteriors.

    Each adds a fault to a combination with one fault less. The covariance of each is that without a fault, less the
    square of a column times a share for each fault.

    Attributes:
        off: (n, k) which instruments are faulty.
        log_weight: (n,) log probability of each combination, up to a common constant.
        centres, variances: (n, k) mean and variances of its Gaussian.
        columns, shares: (n, f, k) and (n, f), those of the last fault come last.
        before: (n,) index of the combination with one fault less.
    """

    off: np.ndarray
    log_weight: np.ndarray
    centres: np.ndarray
    variances: np.ndarray
    columns: np.ndarray
    shares: np.ndarray
    before: np.ndarray

    @classmethod
    def sound(cls, spread: np.ndarray, rhs: np.ndarray) -> _Ways:
        """Return the combination without a fault, of this covariance (k, k)."""
        k, centre = len(rhs), spread @ rhs
        log_weight = 0.5 * (centre @ rhs + np.linalg.slogdet(spread)[1])
        none = np.zeros((1, k), dtype=bool), np.zeros((1, 0, k)), np.zeros((1, 0)), np.zeros(1, dtype=int)
        return cls(none[0], np.array([log_weight]), centre[None], np.diag(spread)[None], *none[1:])

    def one_fault_more(self, faults: _Faults, spread: np.ndarray, least: float) -> _Ways:
        """Return the likeliest that add a fault to one of these, by rank-one updates (Sherman-Morrison).

        `spread` (k, k) is the covariance without a fault, `least` the smallest log probability of interest.
        """
        k, change, pull = len(spread), faults.precision, faults.pull
        left = np.where(self.off, 1.0, 1.0 + change * self.variances)
        moved = change * self.centres - pull
        away = moved * self.centres - pull * (self.centres + pull * self.variances)
        log_weight = self.log_weight[:, None] + faults.log_odds - 0.5 * (np.log(left) + away / left)
        log_weight[self.off] = -np.inf
        before, fault = self._likeliest(log_weight, least, min(_MOST_WAYS, max(_FEWEST_WAYS, _MOST_NUMBERS // k**2)))
        columns, shares, rows = self.columns[before], self.shares[before], np.arange(len(before))
        column = spread[fault] - np.einsum("nf,nfk->nk", shares * columns[rows, :, fault], columns)
        share, step = ((part / left)[before, fault][:, None] for part in (np.broadcast_to(change, left.shape), moved))
        return _Ways(
            self.off[before] | np.eye(k, dtype=bool)[fault],
            log_weight[before, fault],
            self.centres[before] - step * column,
            self.variances[before] - share * np.square(column),
            np.concatenate([columns, column[:, None]], axis=1),
            np.concatenate([shares, share], axis=1),
            before,
        )

    def _likeliest(self, log_weight: np.ndarray, least: float, most: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the likeliest combinations with one fault more, as (m,) previous combination (n) and (m,) fault (k).

        Each is returned once, although it is reached as often as it has faults.
        """
        k, flat = log_weight.shape[1], log_weight.ravel()
        likely = np.flatnonzero(flat > least)
        met = most * (1 + int(self.off[0].sum()))
        if len(likely) > met:
            likely = likely[np.argpartition(flat[likely], len(likely) - met)[-met:]]
        before, fault = np.divmod(likely[np.argsort(-flat[likely])], k)
        words = _in_words(self.off)[before] | _in_words(np.eye(k, dtype=bool))[fault]
        same = np.lexsort(words.T)
        new = np.ones(len(same), dtype=bool)
        new[1:] = (words[same[1:]] != words[same[:-1]]).any(axis=1)
        once = np.sort(same[new])[:most]
        return before[once], fault[once]

    def squares(self, weights: np.ndarray, with_more: np.ndarray) -> np.ndarray:
        """Return the sum (k, k) of squared means weighted by `weights` (n,), less the last faults by `with_more`."""
        result: np.ndarray = (weights * self.centres.T) @ self.centres
        if self.shares.size:
            result -= (with_more * self.shares[:, -1] * self.columns[:, -1].T) @ self.columns[:, -1]
        return result


def _in_words(off: np.ndarray) -> np.ndarray:
    """Pack (n, k) booleans into words (n, w), with 64 instruments in each number."""
    faulty = np.packbits(off, axis=1)
    words = np.zeros((len(off), -(-off.shape[1] // 64)), np.uint64)
    words.view(np.uint8)[:, : faulty.shape[1]] = faulty
    return words
