"""Many people who are known a little: their mean and spread are found, and left-out people are estimated better."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import PriorError
from kinertia.estimation.learnt_prior import BETWEEN, WITHIN, PersonInformation, information_of, learn
from kinertia.estimation.prior import literature_prior
from kinertia.synthetic.walk import walking_subject
from validation.population_bodies import POPULATIONS

WHOLE = literature_prior(walking_subject().literature)
SEGMENTS = WHOLE.mean.segments[:4]
SIZE = 10 * len(SEGMENTS)
PRIOR = replace(
    WHOLE,
    mean=type(WHOLE.mean).from_table(SEGMENTS, WHOLE.mean.table()[:4]),
    covariance=WHOLE.covariance[:SIZE, :SIZE],
)
R = PRIOR.covariance / np.outer(PRIOR.sd, PRIOR.sd)


def group(rng, count):
    """People of a group, each seen in some directions only: truth (p, k) and what their recordings say."""
    root = np.linalg.cholesky(R)
    mean = np.sqrt(BETWEEN) * root @ rng.standard_normal(SIZE)
    truth = mean + np.sqrt(WITHIN) * (root @ rng.standard_normal((SIZE, count))).T
    people = []
    for k, person in enumerate(truth):
        seen = rng.standard_normal((12, SIZE)) / np.sqrt(SIZE) / 0.3
        noisy = seen @ person + rng.standard_normal(12)
        people.append(PersonInformation(f"p{k}", PRIOR, seen.T @ seen, seen.T @ noisy))
    return mean, truth, people


def estimate(person, mean, covariance):
    """Of one person with this prior: mean and deviations."""
    inverse = np.linalg.inv(covariance)
    posterior = np.linalg.inv(person.information + inverse)
    return posterior @ (person.rhs + inverse @ mean), np.sqrt(np.diag(posterior))


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
    silent = [replace(person, information=np.zeros((SIZE, SIZE)), rhs=np.zeros(SIZE)) for person in people]
    learnt = learn(silent)
    np.testing.assert_allclose(learnt.mean, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diag(learnt.covariance), BETWEEN + WITHIN, rtol=1e-6)
    alone = [k for k in range(SIZE) if k % 10 < 4]  # inertia goes with the mean's mass
    expected = (BETWEEN + WITHIN) * R[np.ix_(alone, alone)]
    np.testing.assert_allclose(learnt.covariance[np.ix_(alone, alone)], expected, atol=0.02)
    assert learnt.covariance[0, 4] > 0.4 * BETWEEN
    assert np.abs(learnt.learnt).max() < 1e-6


@pytest.mark.slow
def test_the_mean_of_obese_people_is_recovered_and_left_out_people_profit(fit):
    """What one walk shows of a body, by a fit; bodies and noise are drawn, 60 people to learn from and 40 more."""
    seen = information_of(fit)
    prior, sd, rng = seen.literature, seen.literature.sd.ravel(), np.random.default_rng(3)
    obese = POPULATIONS["obese"].of(prior)
    values, vectors = np.linalg.eigh(seen.information)
    root = vectors * np.sqrt(np.maximum(values, 0.0))

    def relative(body):
        return (body.table() - prior.mean.table()).ravel() / sd

    truth = [relative(obese.draw(rng)) for _ in range(100)]
    people = [
        replace(seen, name=f"p{k}", rhs=seen.information @ body + root @ rng.standard_normal(len(sd)))
        for k, body in enumerate(truth)
    ]
    learnt, shift = learn(people[:60]), relative(obese.mean)
    error, informed = learnt.mean - shift, learnt.mean_sd < 0.5
    assert informed.sum() > 10
    assert np.mean(np.abs(error) < 1.96 * learnt.mean_sd) > 0.9
    assert np.mean(np.abs(error[informed]) < 1.96 * learnt.mean_sd[informed]) > 0.9
    # of thighs and pelvis a task shows less than of other segments
    assert np.sqrt(np.mean(error[informed] ** 2)) < 0.45 * np.sqrt(np.mean(shift[informed] ** 2))

    adults, spread = np.zeros(len(sd)), prior.covariance / np.outer(sd, sd)
    priors = [(adults, spread), (learnt.mean, learnt.covariance), (shift, spread)]
    errors, within = np.zeros((3, 40, len(sd))), []
    for i, (person, body) in enumerate(zip(people[60:], truth[60:], strict=True)):
        for j, (mean, covariance) in enumerate(priors):
            after, deviations = estimate(person, mean, covariance)
            errors[j, i] = (after - body) * sd
            if j == 1:
                within.append(np.abs(after - body) < 1.96 * deviations)
    assert 0.93 < np.mean(within) < 0.98
    by_kind = errors.reshape(3, 40, -1, 10)
    for columns, most in ((slice(0, 1), 0.90), (slice(1, 4), 0.985), (slice(4, 7), 0.65)):
        single, after, bound = np.sqrt(np.mean(np.square(by_kind[..., columns]), axis=(1, 2, 3)))
        assert bound < after < most * single


def test_the_prior_of_a_person_is_about_his_own_literature():
    _, _, people = group(np.random.default_rng(2), 20)
    learnt = learn(people)
    of_person = learnt.of(PRIOR)
    np.testing.assert_allclose((of_person.mean.table() - PRIOR.mean.table()).ravel(), learnt.mean * PRIOR.sd.ravel())
    np.testing.assert_allclose(of_person.sd.ravel(), np.sqrt(np.diag(learnt.covariance)) * PRIOR.sd.ravel())
    with pytest.raises(PriorError, match="S405"):
        learnt.of(WHOLE)


def test_too_few_people_or_two_models_are_refused():
    _, _, people = group(np.random.default_rng(3), 6)
    with pytest.raises(PriorError, match=r"S409 A group of 4 .* at least 5"):
        learn(people[:4])
    other = replace(people[0], name="x", literature=WHOLE)
    with pytest.raises(PriorError, match=r"S409 x .* a different model from p0"):
        learn([*people, other])
