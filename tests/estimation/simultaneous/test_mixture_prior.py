from itertools import product
from math import exp

import numpy as np
import pytest
from scipy.integrate import quad

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture, GaussianPrior, log_chance

PLATE = FaultMixture(0.001, 0.015, 0.1)
DELAY_S = FaultMixture(0.0003, 0.005, 0.2, faulty_mean=0.006)


def normal(x: float, mean: float, sd: float) -> float:
    """Density, but for a factor that all have."""
    return exp(-0.5 * ((x - mean) / sd) ** 2) / sd


def density(prior: FaultMixture, x: float) -> float:
    share = prior.fault_probability
    faulty = normal(x, prior.faulty_mean, prior.faulty_sd)
    return (1.0 - share) * normal(x, 0.0, prior.nominal_sd) + share * faulty


@pytest.mark.parametrize("prior", [PLATE, DELAY_S])
@pytest.mark.parametrize(("mean", "sd"), [(0.0, 0.002), (0.004, 0.002), (-0.012, 0.006), (0.02, 0.003)])
def test_one_quantity_has_the_mean_and_deviation_of_the_product(prior, mean, sd):
    """Also where both components are likely, so that the posterior is wider than with any Gaussian prior."""

    def part(power):
        def value(x):
            return x**power * density(prior, x) * normal(x, mean, sd)

        return quad(value, -0.1, 0.1, points=[0.0, prior.faulty_mean, mean], limit=200, epsabs=0, epsrel=1e-6)[0]

    posterior_mean, covariance = posterior([prior], np.eye(1) / sd**2, np.array([mean / sd**2]))
    expected = part(1) / part(0)
    assert posterior_mean[0] == pytest.approx(expected, rel=1e-4, abs=1e-9)
    assert covariance[0, 0] == pytest.approx(part(2) / part(0) - expected**2, rel=1e-3)


def test_a_certain_prior_stays_what_it_is():
    priors = ErrorPriors((FaultMixture.certain(0.01), FaultMixture.certain(0.2)))
    covariance = np.array([[2e-5, 1e-5], [1e-5, 0.01]])
    updated = GaussianPrior.of(priors).updated(priors, np.array([0.02, -0.1]), covariance)
    np.testing.assert_allclose(updated.precision, np.diag([1e4, 25.0]), atol=1e-6)
    np.testing.assert_allclose(updated.pull, 0.0, atol=1e-9)


def posterior(priors, data, rhs):
    """Mean and covariance of quantities that data (k, k) and right (k,) tell of."""
    priors = priors if isinstance(priors, ErrorPriors) else ErrorPriors(tuple(priors))
    sites = GaussianPrior.of(priors)
    for _ in range(3):
        covariance = np.linalg.inv(data + sites.precision)
        sites = sites.updated(priors, covariance @ (rhs + sites.pull), covariance)
    covariance = np.linalg.inv(data + sites.precision)
    return covariance @ (rhs + sites.pull), covariance


def test_the_plate_that_is_off_takes_the_whole_error():
    """Their difference is known to 1 mm, their mean to 6 mm: a single Gaussian would share 20 mm out."""
    apart, together = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    data = np.outer(apart, apart) / 0.001**2 + np.outer(together, together) / 0.006**2
    truth = np.array([0.0, -0.020])
    mean, covariance = posterior([PLATE, PLATE], data, data @ truth)
    np.testing.assert_allclose(mean, truth, atol=0.002)
    assert np.sqrt(covariance[1, 1]) < 0.005
    alone = np.linalg.solve(data + np.eye(2) / PLATE.sd**2, data @ truth)
    assert alone[0] > 0.004


def test_sound_plates_stay_where_they_are():
    """Though skin motion says 5 mm, with a deviation of 6 mm."""
    data = np.eye(1) / 0.006**2
    mean, covariance = posterior([PLATE], data, data @ [0.005])
    assert 0.0 < mean[0] < 0.0008
    assert PLATE.nominal_sd < np.sqrt(covariance[0, 0]) < 0.004


def test_nothing_jumps():
    """As the data go on from a sound plate to one that is off, the posterior mean goes with them."""
    data = np.eye(2) / 0.003**2
    means = [posterior([PLATE, PLATE], data, data @ [x, 0.004])[0] for x in np.linspace(0.0, 0.02, 81)]
    assert np.abs(np.diff(means, axis=0)).max() < 0.002
    assert (np.diff(np.array(means)[:, 0]) > 0.0).all()


@pytest.mark.parametrize("faults", [2, 4, 9])
def test_of_many_instruments_any_number_may_be_faulty(faults):
    """Three walks on plates that nobody tells apart have a fault each, and the clock one more."""
    priors = [PLATE] * 28
    data = np.eye(28) / 0.003**2
    truth = np.zeros(28)
    truth[3 * np.arange(faults)] = 0.03 * (-1.0) ** np.arange(faults)
    mean, _ = posterior(priors, data, data @ truth)
    np.testing.assert_allclose(mean, truth, atol=0.002)


def test_the_plates_that_are_off_take_the_whole_error_in_every_trial():
    """Of each pair the difference is known to 1 mm, the mean to 6 mm; the last three quantities are sound."""
    apart, together = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    data = np.eye(23) / 0.003**2
    truth = np.zeros(23)
    for pair in range(10):
        here = slice(2 * pair, 2 * pair + 2)
        data[here, here] = np.outer(apart, apart) / 0.001**2 + np.outer(together, together) / 0.006**2
        truth[2 * pair] = -0.020 * (pair % 2)
    mean, covariance = posterior([PLATE] * 23, data, data @ truth)
    np.testing.assert_allclose(mean, truth, atol=0.002)
    assert np.sqrt(np.diag(covariance)).max() < 0.005


def of_all_ways(priors, data, rhs):
    """Mean and covariance of the posterior, from every combination of faults."""
    weights, means, covariances = [], [], []
    for way in product([False, True], repeat=len(priors)):
        sd = np.array([prior.faulty_sd if off else prior.nominal_sd for off, prior in zip(way, priors, strict=True)])
        share = [
            prior.fault_probability if off else 1 - prior.fault_probability
            for off, prior in zip(way, priors, strict=True)
        ]
        centre = np.array([prior.faulty_mean if off else 0.0 for off, prior in zip(way, priors, strict=True)])
        covariances.append(np.linalg.inv(data + np.diag(sd**-2.0)))
        pull = rhs + centre / sd**2
        means.append(covariances[-1] @ pull)
        size = np.linalg.slogdet(covariances[-1])[1] - 2.0 * np.log(sd).sum() - np.square(centre / sd).sum()
        weights.append(np.log(share).sum() + 0.5 * (pull @ means[-1] + size))
    weight = np.exp(np.array(weights) - max(weights))
    covariance = np.average(covariances, axis=0, weights=weight) + np.cov(np.transpose(means), aweights=weight, ddof=0)
    return np.average(means, axis=0, weights=weight), covariance


@pytest.mark.parametrize("count", [1, 4, 7])
def test_the_posterior_is_that_of_all_ways_to_be_sound_or_faulty(count):
    rng = np.random.default_rng(count)
    priors = [FaultMixture(0.001, 0.015, *shares) for shares in rng.uniform([0.02, -0.01], [0.3, 0.01], (count, 2))]
    jacobian = rng.normal(size=(2 * count, count)) / 0.006
    data, rhs = jacobian.T @ jacobian, jacobian.T @ rng.normal(0.0, 2.0, 2 * count)
    mean, covariance = of_all_ways(priors, data, rhs)
    got, spread = posterior(priors, data, rhs)
    np.testing.assert_allclose(got, mean, atol=1e-7)
    np.testing.assert_allclose(spread, covariance, atol=1e-9)


def test_two_faults_may_explain_what_one_does():
    """Forces of the second of two trials are late; or all are, and those of the first were early."""
    trial = FaultMixture(0.00003, 0.010, 0.04)
    priors = [DELAY_S, trial, trial]
    seen = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    data, rhs = seen.T @ seen / 0.0003**2, seen.T @ [0.0, 0.010] / 0.0003**2
    mean, covariance = of_all_ways(priors, data, rhs)
    assert np.sqrt(covariance[1, 1]) > 0.001
    got, spread = posterior(priors, data, rhs)
    np.testing.assert_allclose(got, mean, rtol=1e-4)
    np.testing.assert_allclose(spread, covariance, rtol=1e-4)


def test_plates_that_are_mostly_one_share_a_fault():
    """Three trials show an error of one plate that is hardly enough; each error alone counts as chance."""
    data = np.full((3, 3), 1.0 / 0.0045**2) + np.eye(3) / 0.001**2
    truth = np.full(3, -0.015)
    apart, _ = posterior([PLATE] * 3, data, data @ truth)
    together, covariance = posterior(ErrorPriors((PLATE,) * 3, ((PLATE, (0, 1, 2)),)), data, data @ truth)
    assert (np.abs(together - truth) < 0.7 * np.abs(apart - truth)).all()
    assert (np.abs(together - truth) < np.sqrt(np.diag(covariance))).all()


def test_of_plates_that_are_mostly_one_any_may_be_off_alone():
    data = np.eye(3) / 0.001**2
    truth = np.array([0.0, 0.03, 0.0])
    mean, _ = posterior(ErrorPriors((PLATE,) * 3, ((PLATE, (0, 1, 2)),)), data, data @ truth)
    np.testing.assert_allclose(mean, truth, atol=0.002)


@pytest.mark.parametrize("prior", [PLATE, DELAY_S])
def test_drawn_instruments_have_the_prior_s_deviation(prior):
    rng = np.random.default_rng(1)
    drawn = np.array([prior.draw(rng) for _ in range(20000)])
    assert np.sqrt(np.mean(np.square(drawn))) == pytest.approx(prior.sd, rel=0.05)
    faulty = np.abs(drawn) > 5.0 * prior.nominal_sd
    assert faulty.mean() == pytest.approx(prior.fault_probability, rel=0.4)
    assert np.mean(drawn) == pytest.approx(prior.fault_probability * prior.faulty_mean, abs=0.02 * prior.faulty_sd)


def test_chance_of_data_is_their_mean_under_the_priors():
    """Of two errors that are added to a common one, against sums over a fine grid."""
    single, both = FaultMixture(0.3, 2.0, 0.2), FaultMixture(0.5, 1.5, 0.1, faulty_mean=1.0)
    priors = ErrorPriors((single, single), ((both, (0, 1)),))
    data = np.array([[2.0, 0.5], [0.5, 1.0]])
    grid = np.linspace(-9.0, 9.0, 181)

    def density(prior):
        share = prior.fault_probability
        parts = ((1.0 - share, 0.0, prior.nominal_sd), (share, prior.faulty_mean, prior.faulty_sd))
        return sum(part / sd * np.exp(-0.5 * ((grid - mean) / sd) ** 2) for part, mean, sd in parts)

    a, b, c = np.meshgrid(grid, grid, grid, indexing="ij", sparse=True)
    x, y = a + c, b + c
    densities = density(single)[:, None, None] * density(single)[None, :, None] * density(both)[None, None, :]

    def summed(rhs):
        square = data[0, 0] * x**2 + 2 * data[0, 1] * x * y + data[1, 1] * y**2
        return np.log((densities * np.exp(rhs[0] * x + rhs[1] * y - 0.5 * square)).sum())

    rights = [np.array([3.0, -1.0]), np.array([0.2, 0.1])]
    found = [log_chance(priors, data, rhs) for rhs in rights]
    assert found[0] - found[1] == pytest.approx(summed(rights[0]) - summed(rights[1]), abs=0.02)
