"""What many people teach: mean and spread of a group's body segment parameters, learnt from its fits (empirical Bayes).

Each person's recordings say little about most parameters; all together they say much about *their* mean and spread. A
fit's posterior is its prior times what the recordings say; taken apart, the latter of all people is joined with a
prior of the group: the literature's variance, of which one half is how far a group's mean may be from the tables, and
the other half how far its people are from their mean. Expectation-maximisation (Dempster, Laird & Rubin 1977, J R Stat
Soc B 39:1) finds the mean and covariance of the group; where the people say nothing the literature's stays.

All in relative parameters: distance from the person's own literature values, in the literature's deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.errors import PriorError
from kinertia.estimation.population import population_prior
from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.result import Fit
from kinertia.io.population_file import PopulationFile
from kinertia.model.bsp import BodySegmentParameters

BETWEEN_SHARE = 0.5
"""Of the literature's variance: how far the mean of a group may be from the tables; the rest is within the group."""
PSEUDO_PEOPLE = 30.0
"""The literature's spread within a group counts as much as so many people."""
FEWEST_PEOPLE = 5
_ITERATIONS, _SETTLED = 200, 1e-4
_OWN_PRIOR = 1e-6


@dataclass(frozen=True, eq=False)
class PersonInformation:
    """What one person's recordings say, the prior taken away.

    Attributes:
        name: whose.
        segments: names, as in the tables.
        information: (10 s, 10 s) on the relative parameters.
        right: (10 s,) its right-hand side.
        correlation: (10 s, 10 s) of the literature's prior.
    """

    name: str
    segments: tuple[str, ...]
    information: np.ndarray
    right: np.ndarray
    correlation: np.ndarray


@dataclass(frozen=True, eq=False)
class LearntPrior:
    """A group's people in relative parameters.

    Attributes:
        segments: names.
        mean: (10 s,) of the group.
        mean_sd: (10 s,) how well that is known.
        covariance: (10 s, 10 s) of one more person of the group about `mean`: spread and what is not known of the mean.
        people: how many it was learnt from.
    """

    segments: tuple[str, ...]
    mean: np.ndarray
    mean_sd: np.ndarray
    covariance: np.ndarray
    people: int

    @property
    def learnt(self) -> np.ndarray:
        """(10 s,) 1 - variance / the literature's: 0 nothing learnt."""
        result: np.ndarray = 1.0 - np.diag(self.covariance)
        return result

    @classmethod
    def from_file(cls, file: PopulationFile) -> LearntPrior:
        """What `kinertia population` wrote."""
        mean, mean_sd, covariance = (np.array(values) for values in (file.mean, file.mean_sd, file.covariance))
        return cls(file.segments, mean, mean_sd, covariance, len(file.people))

    def of(self, literature: BspPrior) -> BspPrior:
        """The prior of a person of the group, around the person's own literature values.

        Raises:
            PriorError: it was learnt with another model.
        """
        if literature.mean.segments != self.segments:
            raise PriorError(
                f"the group's prior is of the segments {', '.join(self.segments)}; this model has "
                f"{', '.join(literature.mean.segments)}: learn it from fits with the same model"
            )
        sd = literature.sd.ravel()
        table = literature.mean.table().ravel() + sd * self.mean
        mean = BodySegmentParameters.from_table(self.segments, table)
        return replace(literature, mean=mean, covariance=self.covariance * np.outer(sd, sd))


def information_of(fit: Fit) -> PersonInformation:
    """What the recordings of a fit say.

    Raises:
        PriorError: it has no error bars, or leant on another prior than the literature's.
    """
    name = fit.subject.name
    if fit.posterior is None:
        raise PriorError(f"{name}: estimated by the two-level method, which has no error bars")
    literature = literature_prior(fit.literature)
    sd = literature.sd.ravel()
    own = population_prior(literature, fit.subject).prior
    if fit.file is not None or not np.allclose(fit.posterior.prior_sd, own.sd, rtol=_OWN_PRIOR):
        raise PriorError(f"{name}: leant on another prior than the literature's of the built-in model")
    correlation, before = (prior.covariance / np.outer(sd, sd) for prior in (literature, own))
    posterior = np.linalg.inv(fit.posterior.covariance / np.outer(sd, sd))
    moved = (fit.estimate.table() - fit.literature.table()).ravel() / sd
    values, vectors = np.linalg.eigh(posterior - np.linalg.inv(before))
    information = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return PersonInformation(name, fit.literature.segments, information, posterior @ moved, correlation)


def learn(people: Sequence[PersonInformation], start: LearntPrior | None = None) -> LearntPrior:
    """The group's prior.

    Args:
        people: of one group, at least `FEWEST_PEOPLE`.
        start: of nearly the same people, for a quicker search.

    Raises:
        PriorError: too few, or estimated with different models.
    """
    if len(people) < FEWEST_PEOPLE:
        raise PriorError(f"{len(people)} people; a group's mean and spread take at least {FEWEST_PEOPLE}")
    segments = people[0].segments
    if other := next((one for one in people if one.segments != segments), None):
        raise PriorError(f"{other.name} was estimated with another model than {people[0].name}")
    literature = np.mean([one.correlation for one in people], axis=0)
    information = np.array([one.information for one in people])
    right = np.array([one.right for one in people])
    of_mean = np.linalg.inv(BETWEEN_SHARE * literature)
    anchor = (1.0 - BETWEEN_SHARE) * literature
    mean = np.zeros(len(literature)) if start is None else start.mean
    within, count = anchor, len(people)
    for _ in range(_ITERATIONS):
        inverse = np.linalg.inv(within)
        posterior = np.linalg.inv(information + inverse)
        estimates = np.einsum("pij,pj->pi", posterior, right + inverse @ mean)
        new_mean = np.linalg.solve(of_mean + count * inverse, inverse @ estimates.sum(axis=0))
        away = estimates - new_mean
        spread = posterior.sum(axis=0) + away.T @ away
        new_within = (PSEUDO_PEOPLE * anchor + spread) / (PSEUDO_PEOPLE + count)
        change = max(np.abs(new_mean - mean).max(), np.abs(new_within - within).max())
        mean, within = new_mean, 0.5 * (new_within + new_within.T)
        if change < _SETTLED:
            break
    # of each person's estimate with a flat prior, the variance is that of the data plus the spread
    inverse = np.linalg.inv(within)
    each = inverse - inverse @ np.linalg.inv(information + inverse) @ inverse
    of_group = np.linalg.inv(of_mean + each.sum(axis=0))
    return LearntPrior(segments, mean, np.sqrt(np.diag(of_group)), within + of_group, count)
