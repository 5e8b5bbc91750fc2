"""What many people teach: mean and spread of a group's body segment parameters, learnt from its fits (empirical Bayes).

Each person's recordings say little about most parameters; all together they say much about *their* mean and spread. A
fit's posterior is its prior times what the recordings say; taken apart, the latter of all people is joined with a
prior of the group: its people are as far from their mean as the literature's are, and their mean is off the tables by
half of that variance. Expectation-maximisation (Dempster, Laird & Rubin 1977, J R Stat Soc B 39:1) finds the mean and
covariance of the group. Where the people say nothing, its error bars are wider than the literature's, which are those
of a person of the tables.

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

BETWEEN, WITHIN = 0.5, 1.0
"""Variance of a group's mean about the tables, and of its people about their mean, over the literature's."""
PSEUDO_PEOPLE = 30.0
"""The literature's spread within a group counts as much as so many people."""
FEWEST_PEOPLE = 5
_ITERATIONS, _SETTLED = 200, 1e-4
_OWN_PRIOR = 1e-6
_LEAST_SHARE = 0.01
"""Of its prior variance that the recordings take away from a combination, or nothing is learnt from it: below, what the
fit's curvature moves is more than what the recordings say, and all people's would add up."""


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
        """(10 s,) 1 - variance / that of a group of which nothing is known: 0 nothing learnt."""
        result: np.ndarray = 1.0 - np.diag(self.covariance) / (BETWEEN + WITHIN)
        return result

    @classmethod
    def from_file(cls, file: PopulationFile) -> LearntPrior:
        """What `kinertia population` wrote."""
        mean, mean_sd, covariance = (np.array(values) for values in (file.mean, file.mean_sd, file.covariance))
        return cls(file.segments, mean, mean_sd, covariance, len(file.people))

    def as_file(self, version: str, people: Sequence[str], files: Sequence[str]) -> PopulationFile:
        """What is written of it: with the version, the people's names and the SHA-256 of their files."""
        return PopulationFile(
            kinertia=version,
            people=tuple(people),
            files=tuple(files),
            segments=self.segments,
            mean=tuple(self.mean.tolist()),
            mean_sd=tuple(self.mean_sd.tolist()),
            covariance=tuple(tuple(row) for row in self.covariance.tolist()),
        )

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
    own = population_prior(literature, fit.subject).prior
    if fit.file is not None or not np.allclose(fit.posterior.prior_sd, own.sd, rtol=_OWN_PRIOR):
        raise PriorError(f"{name}: leant on another prior than the literature's of the built-in model")
    return person_information(name, literature, own, fit.estimate, fit.posterior.covariance)


def person_information(
    name: str, literature: BspPrior, own: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray
) -> PersonInformation:
    """What recordings say by an estimate that leant on a prior of the literature's mean.

    Args:
        name: whose.
        literature: whose deviations are the units.
        own: that the estimate leant on.
        estimate, covariance: with the posterior covariance (10 s, 10 s) of its table.
    """
    sd = literature.sd.ravel()
    correlation, before, posterior = (
        each / np.outer(sd, sd) for each in (literature.covariance, own.covariance, covariance)
    )
    moved = (estimate.table() - literature.mean.table()).ravel() / sd
    # in coordinates in which the estimate's prior is the unit matrix; what says next to nothing there is left out
    root = np.linalg.cholesky(before)
    inverse = np.linalg.inv(root)
    left, vectors = np.linalg.eigh(inverse @ posterior @ inverse.T)
    along = vectors.T @ inverse @ moved
    shown = left < 1.0 - _LEAST_SHARE
    back = (inverse.T @ vectors)[:, shown]
    information = (back * (1.0 / left[shown] - 1.0)) @ back.T
    return PersonInformation(name, estimate.segments, information, back @ (along[shown] / left[shown]), correlation)


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
    # in coordinates in which the literature's people are uncorrelated, where nothing is close to singular
    root = np.linalg.cholesky(np.mean([one.correlation for one in people], axis=0))
    seen = _Seen.of(root, people)
    size, count = len(root), len(people)
    anchor = WITHIN * np.eye(size)
    mean = np.zeros(size) if start is None else np.linalg.solve(root, start.mean)
    within = anchor
    for _ in range(_ITERATIONS):
        posterior = seen.posterior(within)
        estimates = mean + np.einsum("pij,pj->pi", posterior, seen.right - seen.information @ mean)
        # a mean between nothing and the estimates' own, by how far the group's mean may be from the tables
        new_mean = np.linalg.solve(within / BETWEEN + count * np.eye(size), estimates.sum(axis=0))
        away = estimates - new_mean
        spread = posterior.sum(axis=0) + away.T @ away
        new_within = (PSEUDO_PEOPLE * anchor + spread) / (PSEUDO_PEOPLE + count)
        change = max(np.abs(new_mean - mean).max(), np.abs(new_within - within).max())
        mean, within = new_mean, 0.5 * (new_within + new_within.T)
        if change < _SETTLED:
            break
    of_mean = np.linalg.inv(np.eye(size) / BETWEEN + seen.of_mean(within))
    of_group, whole = (root @ part @ root.T for part in (of_mean, within + of_mean))
    return LearntPrior(segments, root @ mean, np.sqrt(np.diag(of_group)), 0.5 * (whole + whole.T), count)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What all people's recordings say: roots (p, k, k) of the information, itself, and the right-hand sides (p, k)."""

    roots: np.ndarray
    information: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, root: np.ndarray, people: Sequence[PersonInformation]) -> _Seen:
        """In the coordinates x of root x."""
        values, vectors = np.linalg.eigh([root.T @ one.information @ root for one in people])
        roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        return cls(roots, roots @ roots.transpose(0, 2, 1), np.array([root.T @ one.right for one in people]))

    def posterior(self, within: np.ndarray) -> np.ndarray:
        """(p, k, k) covariances of the people, given the spread within the group."""
        seen = within @ self.roots
        inner = np.eye(len(within)) + self.roots.transpose(0, 2, 1) @ seen
        result: np.ndarray = within - seen @ np.linalg.solve(inner, seen.transpose(0, 2, 1))
        return result

    def of_mean(self, within: np.ndarray) -> np.ndarray:
        """(k, k) information of all people on their mean."""
        inner = np.eye(len(within)) + self.roots.transpose(0, 2, 1) @ within @ self.roots
        total: np.ndarray = (self.roots @ np.linalg.solve(inner, self.roots.transpose(0, 2, 1))).sum(axis=0)
        result: np.ndarray = 0.5 * (total + total.T)
        return result
