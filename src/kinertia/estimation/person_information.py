"""Separates the information in one person's recordings from the prior.

Motion and forces are linear in the dynamic parameters: mass, first moment, inertia about the joint. They are not linear
in mass, centre of mass and inertia about it: which combination of these a walk determines depends on the body itself (a
heavy shank shows its centre of mass better), and the mean of many people whose combinations depend on their bodies is
wrong by more than its uncertainty. So the information refers to the dynamic parameters, in coordinates that are, to
first order about the literature's body, the relative parameters: distance from the literature in its standard
deviations.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from kinertia.errors import PriorError
from kinertia.estimation.population import population_prior
from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.result import Fit
from kinertia.findings.finding import with_evidence
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.bsp import BodySegmentParameters, dynamic_by_table

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
    own = population_prior(literature, fit.subject).prior
    # a person whom the plates weigh otherwise is fitted at their mass
    factor = fit.expected.total_mass_kg / own.mean.total_mass_kg
    literature, own = (each.at_mass(factor * each.mass_kg, each.mass_sd_kg) for each in (literature, own))
    if fit.file is not None or not np.allclose(fit.posterior.prior_sd, own.sd, rtol=_OWN_PRIOR):
        raise unusable(name, "estimated with a prior other than the tables for the built-in model")
    return person_information(name, literature, own, fit.estimate, fit.posterior.covariance)


def person_information(
    name: str, literature: BspPrior, own: BspPrior, estimate: BodySegmentParameters, covariance: np.ndarray
) -> PersonInformation:
    """Extract the information in recordings from an estimate.

    Args:
        name: of the person.
        literature: the prior whose standard deviations are the units.
        own: the prior that the estimate used.
        estimate, covariance: the estimate, and the posterior covariance (10 s, 10 s) of its table.
    """
    sd = literature.sd.ravel()
    before, posterior = (each / np.outer(sd, sd) for each in (own.covariance, covariance))
    moved = (estimate.table() - own.mean.table()).ravel() / sd
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
