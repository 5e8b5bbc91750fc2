"""Separates what one person's recordings say of the body from the prior.

Motion and forces are linear in the dynamic parameters: mass, first moment, inertia about the joint. They are not in
mass, centre of mass and inertia about it: which combination of these a walk shows depends on the body itself (a heavy
shank shows its centre of mass better), and the mean of many people whose combinations go with their bodies is wrong by
more than its error bar. So information is on the dynamic parameters, in coordinates that are, to first order about the
literature's body, the relative parameters: distance from the literature in its deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.errors import PriorError, problem_of
from kinertia.estimation.population import population_prior
from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.result import Fit
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import BodySegmentParameters, block_diagonal, dynamic_by_table

_OWN_PRIOR = 1e-6
_LEAST_SHARE = 0.01
"""Of its prior variance that the recordings take away from a combination, or nothing is learnt from it: below, what the
fit's curvature moves is more than what the recordings say, and all people's would add up."""
_STEPS, _SETTLED = 50, 1e-6


@dataclass(frozen=True, eq=False)
class PersonInformation:
    """What one person's recordings say, the prior taken away.

    Attributes:
        name: whose.
        literature: the prior of that person by the literature; its deviations are the units.
        information: (10 s, 10 s) on the dynamic parameters, in relative coordinates.
        right: (10 s,) its right-hand side.
    """

    name: str
    literature: BspPrior
    information: np.ndarray
    right: np.ndarray

    @property
    def segments(self) -> tuple[str, ...]:
        """Names, as in the tables."""
        return self.literature.mean.segments

    def with_prior(self, prior: BspPrior) -> tuple[BodySegmentParameters, np.ndarray]:
        """The estimate that recordings and this prior make together, and the covariance (10 s, 10 s) of its table."""
        sd, literature = self.literature.sd.ravel(), self.literature.mean.table().ravel()
        mean = (prior.mean.table().ravel() - literature) / sd
        before = np.linalg.inv(prior.covariance / np.outer(sd, sd))

        def body_of(relative: np.ndarray) -> BodySegmentParameters:
            return BodySegmentParameters.from_table(self.segments, (literature + sd * relative).reshape(-1, 10))

        def cost(relative: np.ndarray) -> float:
            _, dynamic = _relative(self.literature, body_of(relative))
            away = relative - mean
            return float(dynamic @ (0.5 * self.information @ dynamic - self.right) + 0.5 * away @ before @ away)

        relative = mean
        for _ in range(_STEPS):
            along, dynamic = _relative(self.literature, body_of(relative))
            curvature = along.T @ self.information @ along + before
            step = np.linalg.solve(
                curvature, along.T @ (self.right - self.information @ dynamic) - before @ (relative - mean)
            )
            while np.abs(step).max() > _SETTLED and cost(relative + step) > cost(relative):
                step = 0.5 * step
            relative = relative + step
            if np.abs(step).max() <= _SETTLED:
                break
        body = body_of(relative)
        return body, np.linalg.inv(curvature) * np.outer(sd, sd)


def _relative(literature: BspPrior, body: BodySegmentParameters) -> tuple[np.ndarray, np.ndarray]:
    """Derivative (10 s, 10 s) of the relative dynamic coordinates by the relative parameters at a body, and the
    coordinates (10 s,) of the body."""
    sd, at = literature.sd.ravel(), literature.mean
    back = np.linalg.inv(block_diagonal(dynamic_by_table(at.mass_kg, at.com_m)))
    along = back @ block_diagonal(dynamic_by_table(body.mass_kg, body.com_m))
    moved = back @ (body.dynamic_parameters().ravel() - at.dynamic_parameters().ravel())
    return along * sd / sd[:, None], moved / sd


def unusable(person: str, reason: str, **evidence: Quantity) -> PriorError:
    """S409: a person, or a group, from whom no prior can be learnt."""
    found = with_evidence(
        "S409", Where(part=person), {**evidence, "person": Quantity(person), "reason": Quantity(reason)}
    )
    return PriorError(problem_of(found)).with_finding(found)


def information_of(fit: Fit) -> PersonInformation:
    """What the recordings of a fit say.

    Raises:
        PriorError: it has no error bars, or leant on another prior than the literature's.
    """
    name = fit.subject.name
    if fit.posterior is None:
        raise unusable(name, "estimated by the two-level method, which has no error bars")
    literature = literature_prior(fit.literature)
    own = population_prior(literature, fit.subject).prior
    if fit.file is not None or not np.allclose(fit.posterior.prior_sd, own.sd, rtol=_OWN_PRIOR):
        raise unusable(name, "estimated with another prior than the tables' for the built-in model")
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
    before, posterior = (each / np.outer(sd, sd) for each in (own.covariance, covariance))
    moved = (estimate.table() - literature.mean.table()).ravel() / sd
    # in coordinates in which the estimate's prior is the unit matrix; what says next to nothing there is left out
    root = np.linalg.cholesky(before)
    inverse = np.linalg.inv(root)
    left, vectors = np.linalg.eigh(inverse @ posterior @ inverse.T)
    along = vectors.T @ inverse @ moved
    shown = left < 1.0 - _LEAST_SHARE
    back = (inverse.T @ vectors)[:, shown]
    information = (back * (1.0 / left[shown] - 1.0)) @ back.T
    score = back @ (along[shown] / left[shown]) - information @ moved
    # of the relative parameters at the estimate; now of the dynamic ones
    derivative, dynamic = _relative(literature, estimate)
    to_dynamic = np.linalg.inv(derivative)
    information = to_dynamic.T @ information @ to_dynamic
    return PersonInformation(name, literature, information, information @ dynamic + to_dynamic.T @ score)
