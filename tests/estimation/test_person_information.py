"""What a person's recordings say, taken out of an estimate and put back."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.learnt_prior import PersonInformation, person_information
from kinertia.estimation.prior import literature_prior
from kinertia.synthetic.walk import walking_subject
from validation.other_prior import with_prior
from validation.population_bodies import POPULATIONS

PRIOR = literature_prior(walking_subject().literature)
SIZE = PRIOR.covariance.shape[0]


def seen(seed):
    """A person of whom twenty combinations are known well."""
    rng = np.random.default_rng(seed)
    rows = 0.1 * rng.standard_normal((20, SIZE))
    body = ((PRIOR.draw(rng).table() - PRIOR.mean.table()) / PRIOR.sd).ravel()
    return PersonInformation("", PRIOR, rows.T @ rows, rows.T @ rows @ body)


@pytest.mark.slow
def test_what_is_taken_out_of_an_estimate_does_not_depend_on_its_prior():
    """Nor on the body at which the fit linearised: the same recordings by two priors far apart."""
    person = seen(0)
    far = POPULATIONS["obese"].of(PRIOR)
    for prior in (PRIOR, replace(PRIOR, covariance=2.0 * PRIOR.covariance), PRIOR.at_mass(0.9 * PRIOR.mass_kg, 0.5)):
        estimate, covariance = with_prior(person, prior)
        out = person_information("", PRIOR, prior, estimate, covariance)
        np.testing.assert_allclose(out.information, person.information, atol=1e-4 * np.abs(person.information).max())
        np.testing.assert_allclose(out.rhs, person.rhs, atol=1e-4 * np.abs(person.rhs).max())
        again, _ = with_prior(out, far)
        np.testing.assert_allclose(again.table(), with_prior(person, far)[0].table(), atol=1e-3)


def test_recordings_that_say_nothing_leave_the_prior():
    silent = PersonInformation("", PRIOR, np.zeros((SIZE, SIZE)), np.zeros(SIZE))
    estimate, covariance = with_prior(silent, PRIOR)
    np.testing.assert_allclose(estimate.table(), PRIOR.mean.table())
    np.testing.assert_allclose(covariance, PRIOR.covariance, atol=1e-9)
