"""Many people who are known a little: their mean and spread are found, and left-out people are estimated better."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import PriorError
from kinertia.estimation.learnt_prior import BETWEEN, WITHIN, PersonInformation, learn
from kinertia.estimation.prior import literature_prior
from kinertia.synthetic.walk import walking_subject

PRIOR = literature_prior(walking_subject().literature)
SEGMENTS = PRIOR.mean.segments[:4]
SIZE = 10 * len(SEGMENTS)
R = (PRIOR.covariance / np.outer(PRIOR.sd, PRIOR.sd))[:SIZE, :SIZE]


def group(rng, count, mean=None, within=WITHIN):
    """People of a group, each seen in some directions only: truth (p, k) and what their recordings say."""
    root = np.linalg.cholesky(R)
    mean = np.sqrt(BETWEEN) * root @ rng.standard_normal(SIZE) if mean is None else mean
    truth = mean + np.sqrt(within) * (root @ rng.standard_normal((SIZE, count))).T
    people = []
    for k, person in enumerate(truth):
        seen = rng.standard_normal((12, SIZE)) / np.sqrt(SIZE) / 0.3
        noisy = seen @ person + rng.standard_normal(12)
        people.append(PersonInformation(f"p{k}", SEGMENTS, seen.T @ seen, seen.T @ noisy, R))
    return mean, truth, people


def estimate(person, mean, covariance):
    """Of one person with this prior: mean and deviations."""
    inverse = np.linalg.inv(covariance)
    posterior = np.linalg.inv(person.information + inverse)
    return posterior @ (person.right + inverse @ mean), np.sqrt(np.diag(posterior))


@pytest.mark.slow
def test_left_out_people_are_estimated_better_and_their_error_bars_hold():
    errors, within, of_means = [], [], []
    for seed in range(6):
        mean, truth, people = group(np.random.default_rng(seed), 60)
        learnt = learn(people[:40])
        for person, true in zip(people[40:], truth[40:], strict=True):
            after, sd = estimate(person, learnt.mean, learnt.covariance)
            before, _ = estimate(person, np.zeros(SIZE), R)
            errors.append([np.square(after - true).mean(), np.square(before - true).mean()])
            within.append(np.abs(after - true) < 1.96 * sd)
        of_means.append((learnt.mean - mean) / learnt.mean_sd)
    after, before = np.sqrt(np.mean(errors, axis=0))
    assert after < 0.9 * before
    assert 0.93 < np.mean(within) < 0.97
    assert 0.9 < np.mean(np.abs(of_means) < 1.96) < 0.99


def test_where_people_say_nothing_the_mean_stays_and_bars_grow():
    _, _, people = group(np.random.default_rng(0), 20)
    silent = [replace(one, information=np.zeros((SIZE, SIZE)), right=np.zeros(SIZE)) for one in people]
    learnt = learn(silent)
    np.testing.assert_allclose(learnt.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(learnt.covariance, (BETWEEN + WITHIN) * R, atol=1e-6)
    assert np.abs(learnt.learnt).max() < 1e-6


@pytest.mark.slow
def test_a_start_elsewhere_ends_at_the_same():
    _, _, people = group(np.random.default_rng(1), 40)
    one, other = learn(people), learn(people, start=learn(people[1:]))
    np.testing.assert_allclose(one.mean, other.mean, atol=0.02)


def test_the_prior_of_a_person_is_about_his_own_literature():
    _, _, people = group(np.random.default_rng(2), 20)
    learnt = learn(people)
    part = replace(
        PRIOR,
        mean=type(PRIOR.mean).from_table(SEGMENTS, PRIOR.mean.table()[:4]),
        covariance=PRIOR.covariance[:SIZE, :SIZE],
    )
    own = learnt.of(part)
    np.testing.assert_allclose((own.mean.table() - part.mean.table()).ravel(), learnt.mean * part.sd.ravel())
    np.testing.assert_allclose(own.sd.ravel(), np.sqrt(np.diag(learnt.covariance)) * part.sd.ravel())
    with pytest.raises(PriorError, match="learn it from fits with the same model"):
        learnt.of(PRIOR)


def test_too_few_people_or_two_models_are_refused():
    _, _, people = group(np.random.default_rng(3), 6)
    with pytest.raises(PriorError, match="4 people; a group's mean and spread take at least 5"):
        learn(people[:4])
    other = replace(people[0], name="x", segments=("a", "b", "c", "d"))
    with pytest.raises(PriorError, match="x was estimated with another model than p0"):
        learn([*people, other])
