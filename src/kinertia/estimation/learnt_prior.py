"""Learns the mean and spread of a group's body segment parameters from its fits (empirical Bayes).

Each person's recordings contain little information on most parameters; together they contain much on the group's mean
and spread. A fit's posterior is its prior times the information of the recordings. That information, from all people,
is combined with a prior of the group, and expectation-maximisation (Dempster, Laird & Rubin 1977, J R Stat Soc B 39:1)
finds the mean and covariance of the group. Where the people contribute nothing, the group's uncertainty is larger than
the literature's, which applies to a person of the tables.

The prior of the group:

- people vary about the group's mean as they do about the tables; this assumption has the weight of 120 people;
- the group's mean differs much from the tables in a few parameters and little in most: Student's t with 3 degrees of
  freedom, one draw for a parameter of both sides (Tipping 2001, J Mach Learn Res 1:211, does it for single weights). A
  normal prior would attribute a heavy trunk in part to any other parameter that could explain the trials, and many
  people would be needed to correct that;
- a heavier mean segment has proportionally larger moments of inertia.

All parameters are relative: distance from the person's own literature values, in the literature's standard deviations.
The information of the recordings is linear in the dynamic parameters (`person_information`); the mean and spread of
these are used for those of masses, centres of mass and moments about them, which is correct to first order.

Motion and forces are linear in the dynamic parameters: mass, first moment, inertia about the joint. They are not linear
in mass, centre of mass and inertia about it: which combination of these a walk determines depends on the body itself (a
heavy shank shows its centre of mass better), and the mean of many people whose combinations depend on their bodies is
wrong by more than its uncertainty. So the information refers to the dynamic parameters, in coordinates that are, to
first order about the literature's body, the relative parameters: distance from the literature in its standard
deviations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from kinertia.errors import PriorError
from kinertia.estimation.prior import BspPrior, literature_prior, population_prior
from kinertia.estimation.result.fit import Fit
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.subject.learnt_files import PopulationFile
from kinertia.model.bsp import BodySegmentParameters, dynamic_by_table
from kinertia.model.skeleton import by_side

BETWEEN, WITHIN = 0.4, 1.0
"""Variances of a group's mean about the tables, and of its people about their mean, relative to the literature's."""
PSEUDO_PEOPLE = 120.0
"""The literature's spread within a group counts as much as so many people: as many as a body has parameters, since
estimating the correlations of so many takes more people than groups have."""
_FREEDOM = 3.0
"""Degrees of freedom of Student's t for the mean."""
_TAILS = _FREEDOM / (_FREEDOM - 2.0)
"""Variance of Student's t over its squared scale."""
_PSEUDO_SCALES = 4.0
"""`BETWEEN` counts as much as so many parameters' means in estimating the scale that they have in common."""
FEWEST_PEOPLE = 5
_ITERATIONS, _SETTLED = 200, 1e-3
_NOTHING = 1e-12
"""Eigenvalues of the information below this share of the largest are rounding errors."""
_OWN_PRIOR = 1e-6
_LEAST_SHARE = 0.01
"""Least share of a combination's prior variance that the recordings remove; below it nothing is learnt from it, since
errors of the fit's curvature exceed the information of the recordings and would add up over people."""


@dataclass(frozen=True, eq=False)
class PersonInformation:
    """Information in one person's recordings, without the prior.

    Attributes:
        name: of the person.
        literature: the person's prior from the literature; its standard deviations are the units.
        information: (10 s, 10 s) on the dynamic parameters, in relative coordinates.
        rhs: (10 s,) its right-hand side.
    """

    name: str
    literature: BspPrior
    information: np.ndarray
    rhs: np.ndarray

    @property
    def segments(self) -> tuple[str, ...]:
        """Segment names, as in the tables."""
        return self.literature.mean.segments


def relative_parameters(literature: BspPrior, body: BodySegmentParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative dynamic coordinates of a body, and their derivative with respect to the relative parameters.

    The derivative (10 s, 10 s) comes first, then the coordinates (10 s,).
    """
    sd, at = literature.sd.ravel(), literature.mean
    back = np.linalg.inv(block_diag(*dynamic_by_table(at.mass_kg, at.com_m)))
    along = back @ block_diag(*dynamic_by_table(body.mass_kg, body.com_m))
    moved = back @ (body.dynamic_parameters().ravel() - at.dynamic_parameters().ravel())
    return along * sd / sd[:, None], moved / sd


def unusable(person: str, reason: str, **evidence: Quantity) -> PriorError:
    """Make the error S409: no prior can be learnt from this person, or group."""
    found = with_evidence(
        "S409", Where(part=person), {**evidence, "person": Quantity(person), "reason": Quantity(reason)}
    )
    return PriorError.of(found)


def information_of(fit: Fit) -> PersonInformation:
    """Extract the information in the recordings of a fit.

    Raises:
        PriorError: the fit has no posterior, or used another prior than the literature's.
    """
    name = fit.subject.name
    if fit.posterior is None:
        raise unusable(name, "estimated by the two-level method, which has no error bars")
    literature = literature_prior(fit.literature)
    used_prior = population_prior(literature, fit.subject).prior
    # a person whom the plates weigh otherwise is fitted at their mass
    factor = fit.expected.total_mass_kg / used_prior.mean.total_mass_kg
    literature, used_prior = (
        prior.at_mass(factor * prior.mass_kg, prior.mass_sd_kg) for prior in (literature, used_prior)
    )
    if fit.file is not None or not np.allclose(fit.posterior.prior_sd, used_prior.sd, rtol=_OWN_PRIOR):
        raise unusable(name, "estimated with a prior other than the tables for the built-in model")
    return person_information(name, literature, used_prior, fit.estimate, fit.posterior.covariance)


def person_information(
    name: str, literature: BspPrior, used_prior: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray
) -> PersonInformation:
    """Extract the information in recordings from an estimate.

    Args:
        name: of the person.
        literature: the prior whose standard deviations are the units.
        used_prior: the prior that the estimate used.
        estimate, covariance: the estimate, and the posterior covariance (10 s, 10 s) of its table.
    """
    sd = literature.sd.ravel()
    before, posterior = (
        table_covariance / np.outer(sd, sd) for table_covariance in (used_prior.covariance, covariance)
    )
    moved = (estimate.table() - used_prior.mean.table()).ravel() / sd
    # in coordinates in which the estimate's prior is the unit matrix; combinations with next to no information are left
    # out
    root = np.linalg.cholesky(before)
    inverse = np.linalg.inv(root)
    left, vectors = np.linalg.eigh(inverse @ posterior @ inverse.T)
    along = vectors.T @ inverse @ moved
    shown = left < 1.0 - _LEAST_SHARE
    back = (inverse.T @ vectors)[:, shown]
    information = (back * (1.0 / left[shown] - 1.0)) @ back.T
    score = back @ along[shown]
    # so far on the relative parameters at the estimate; now on the dynamic ones
    derivative, dynamic = relative_parameters(literature, estimate)
    to_dynamic = np.linalg.inv(derivative)
    information = to_dynamic.T @ information @ to_dynamic
    return PersonInformation(name, literature, information, information @ dynamic + to_dynamic.T @ score)


@dataclass(frozen=True, eq=False)
class LearntPrior:
    """Mean and spread of a group's people, in relative parameters.

    Attributes:
        segments: names.
        mean: (10 s,) mean of the group.
        mean_sd: (10 s,) its standard deviation.
        covariance: (10 s, 10 s) of one more person of the group about `mean`: the group's spread plus the uncertainty
            of the mean.
        people: number of people it was learnt from.
    """

    segments: tuple[str, ...]
    mean: np.ndarray
    mean_sd: np.ndarray
    covariance: np.ndarray
    people: int

    @property
    def learnt(self) -> np.ndarray:
        """Variance reduction (10 s,), 1 - variance / variance of a group without data: 0 means nothing learnt."""
        return np.maximum(0.0, 1.0 - np.diag(self.covariance) / (BETWEEN + WITHIN))

    @classmethod
    def from_file(cls, file: PopulationFile) -> Self:
        """Read the prior from a file of `kinertia population`."""
        mean, mean_sd, covariance = (np.array(values) for values in (file.mean, file.mean_sd, file.covariance))
        return cls(file.segments, mean, mean_sd, covariance, len(file.people))

    def as_file(self, version: str, people: Sequence[str], files: Sequence[str]) -> PopulationFile:
        """Return the file to be written, with the version, the people's names and the SHA-256 of their files."""
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
        """Return the prior of one person of the group, around the person's own literature values.

        Raises:
            PriorError: it was learnt with another model.
        """
        if literature.mean.segments != self.segments:
            group_text = f"a group prior of {len(self.segments)} segments ({', '.join(self.segments)})"
            inputs = {
                "one": Quantity(group_text),
                "other": Quantity(f"a model of {', '.join(literature.mean.segments)}"),
            }
            found = with_evidence("S405", Where(), inputs)
            raise PriorError.of(found)
        sd = literature.sd.ravel()
        table = literature.mean.table().ravel() + sd * self.mean
        mean = BodySegmentParameters.from_table(self.segments, table)
        return replace(literature, mean=mean, covariance=self.covariance * np.outer(sd, sd))


def learn(people: Sequence[PersonInformation]) -> LearntPrior:
    """Learn the group's prior from its people.

    Args:
        people: of one group, at least `FEWEST_PEOPLE`.

    Raises:
        PriorError: there are too few people, or they were estimated with different models.
    """
    if len(people) < FEWEST_PEOPLE:
        reason = f"its mean and spread need at least {FEWEST_PEOPLE}"
        raise unusable(f"A group of {len(people)}", reason, people=Quantity(len(people), "1", limit=FEWEST_PEOPLE))
    segments = people[0].segments
    if other := next((person for person in people if person.segments != segments), None):
        raise unusable(other.name, f"estimated with a different model from {people[0].name}")
    # in coordinates in which the literature's people are uncorrelated, so that nothing is nearly singular
    correlations = np.mean([_correlation(person.literature.covariance) for person in people], axis=0)
    root = np.linalg.cholesky(correlations)
    seen, means = _Seen.of(root, people), _Means.of(root, people)
    anchor = WITHIN * np.eye(len(root))
    within, scales = anchor, np.full(len(means.blocks), BETWEEN / _TAILS)
    for _ in range(_ITERATIONS):
        mean, of_mean = seen.mean(within, means.covariance(scales))
        spread = seen.spread(within, mean, of_mean)
        new_within = (PSEUDO_PEOPLE * anchor + spread) / (PSEUDO_PEOPLE + len(people))
        new_scales = means.scales(mean, of_mean, scales)
        change = max(np.abs(new_within - within).max(), np.abs(np.log(new_scales / scales)).max())
        within, scales = new_within, new_scales
        if change < _SETTLED:
            break
    mean, _ = seen.mean(within, means.covariance(scales))
    _, of_mean = seen.mean(within, means.covariance(_TAILS * scales))
    of_group, whole = (root @ part @ root.T for part in (of_mean, within + of_mean))
    return LearntPrior(segments, root @ mean, np.sqrt(np.diag(of_group)), 0.5 * (whole + whole.T), len(people))


def _correlation(covariance: np.ndarray) -> np.ndarray:
    sd = np.sqrt(np.diag(covariance))
    result: np.ndarray = covariance / np.outer(sd, sd)
    return result


@dataclass(frozen=True, eq=False)
class _Means:
    """Student's t prior of a group's mean, as a normal with one squared scale for each parameter of both sides.

    Attributes:
        root: (k, k) defines the coordinates x used for learning: relative parameters = root x.
        correlation: (k, k) of the mean's relative parameters.
        blocks: rows of the parameters that share a scale.
    """

    root: np.ndarray
    correlation: np.ndarray
    blocks: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, root: np.ndarray, people: Sequence[PersonInformation]) -> Self:
        """Build the prior from the people's literature values."""
        with_mass = np.mean([_moments_with_mass(person.literature) for person in people], axis=0)
        sides = by_side(people[0].segments)
        return cls(
            root,
            _correlation(with_mass @ root @ root.T @ with_mass.T),
            tuple(
                np.array([10 * row + k for row in rows.values() for k in kind])
                for rows in sides.values()
                for kind in ((0,), (1,), (2,), (3,), (4, 5, 6), (7, 8, 9))
            ),
        )

    def covariance(self, scales: np.ndarray) -> np.ndarray:
        """Return the covariance (k, k) of the mean in the coordinates of `root`."""
        row_sd = np.empty(len(self.root))
        for rows, scale in zip(self.blocks, scales, strict=True):
            row_sd[rows] = np.sqrt(scale)
        whole = np.linalg.solve(self.root, row_sd[:, None] * np.linalg.cholesky(self.correlation))
        return whole @ whole.T

    def scales(self, mean: np.ndarray, of_mean: np.ndarray, scales: np.ndarray) -> np.ndarray:
        """Update the squared scales from mean and covariance of the mean, in the coordinates of `root`."""
        square = self.root @ (of_mean + np.outer(mean, mean)) @ self.root.T
        common = (len(scales) + _PSEUDO_SCALES) / (np.sum(1.0 / scales) + _PSEUDO_SCALES * _TAILS / BETWEEN)
        return np.array(
            [
                (_FREEDOM * common + np.trace(np.linalg.solve(self.correlation[at], square[at])))
                / (_FREEDOM + len(rows))
                for rows, at in ((rows, np.ix_(rows, rows)) for rows in self.blocks)
            ]
        )


def _moments_with_mass(literature: BspPrior) -> np.ndarray:
    """Return the matrix (k, k) to relative parameters from those in which radii of gyration are independent of mass."""
    values = literature.mean.table() / literature.sd
    result = np.eye(values.size)
    for row, parameters in enumerate(values):
        result[10 * row + 4 : 10 * row + 10, 10 * row] = parameters[4:] / parameters[0]
    return result


@dataclass(frozen=True, eq=False)
class _Seen:
    """Information of all people's recordings: its roots (p, k, r), and the right-hand sides (p, k)."""

    roots: np.ndarray
    rhs: np.ndarray

    @classmethod
    def of(cls, root: np.ndarray, people: Sequence[PersonInformation]) -> Self:
        """Transform the people's information to the coordinates x of root x."""
        values, vectors = np.linalg.eigh([root.T @ person.information @ root for person in people])
        most = int((values > _NOTHING * values.max()).sum(axis=1).max())
        roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        return cls(roots[:, :, len(root) - most :], np.array([root.T @ person.rhs for person in people]))

    def mean(self, within: np.ndarray, between: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute the group's mean and its covariance, given the spread within the group and of group means."""
        inner = np.linalg.inv(np.eye(self.roots.shape[2]) + self._inner(within))
        of_all = (self.roots @ inner @ self.roots.transpose(0, 2, 1)).sum(axis=0)
        shown = self.rhs @ within
        rhs = self.rhs - np.einsum("pir,prs,pjs,pj->pi", self.roots, inner, self.roots, shown, optimize=True)
        covariance = np.linalg.inv(np.linalg.inv(between) + of_all)
        covariance = 0.5 * (covariance + covariance.T)
        return covariance @ rhs.sum(axis=0), covariance

    def spread(self, within: np.ndarray, mean: np.ndarray, of_mean: np.ndarray) -> np.ndarray:
        """Return the expected sum of squares (k, k) of the people about their mean."""
        seen = within @ self.roots
        inner = np.linalg.inv(np.eye(self.roots.shape[2]) + self._inner(within))
        # for each person: covariance given the mean, and how the expectation depends on the mean
        posterior = within - seen @ inner @ seen.transpose(0, 2, 1)
        with_mean = seen @ inner @ self.roots.transpose(0, 2, 1)
        away = np.einsum("pij,pj->pi", posterior, self.rhs) - with_mean @ mean
        total: np.ndarray = posterior.sum(axis=0) + away.T @ away
        total += (with_mean @ of_mean @ with_mean.transpose(0, 2, 1)).sum(axis=0)
        result: np.ndarray = 0.5 * (total + total.T)
        return result

    def _inner(self, within: np.ndarray) -> np.ndarray:
        result: np.ndarray = self.roots.transpose(0, 2, 1) @ within @ self.roots
        return result
