"""On a body of one number that goes with the delay, whose linearisation believes in it twice as much as its cost."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture, GaussianPrior
from kinertia.estimation.simultaneous.uncertainty.marginal_posterior import CostProfile, with_left_out

CLOCK, OWN = FaultMixture(0.0003, 0.008, 0.3), FaultMixture(0.00003, 0.01, 0.05)


SHOWN_S, SD_S = 0.004, 0.0015
LAG_S = 0.0007, 0.0012


FOLLOWS, BODY_SD = 20.0, 0.1


@dataclass(frozen=True)
class Place:
    static: np.ndarray


@dataclass(frozen=True)
class Quadratic:
    information: np.ndarray


def cost(static: np.ndarray, n: int) -> float:
    delay = static[:n].sum()
    return 0.5 * (((delay - SHOWN_S) / SD_S) ** 2 + ((static[n] - FOLLOWS * delay) / BODY_SD) ** 2)


def problem(priors):
    n = len(priors)
    layout = SimpleNamespace(errors=slice(0, n), error_priors=ErrorPriors(tuple(priors)))
    return SimpleNamespace(
        layout=layout,
        profiled=lambda: list(range(n)),
        imitated=lambda: LAG_S,
        slope=lambda at: SimpleNamespace(cost=cost(at.static, n)),
    )


def information(n: int, times: float) -> np.ndarray:
    late, body = np.append(np.ones(n), 0.0), np.append(np.full(n, -FOLLOWS), 1.0)
    return times * np.outer(late, late) / SD_S**2 + np.outer(body, body) / BODY_SD**2


def model_of(problem, here: Quadratic, gaussian: GaussianPrior):
    whole, n = here.information.copy(), len(gaussian.pull)
    whole[:n, :n] += gaussian.precision
    root = np.linalg.cholesky(np.linalg.inv(whole))
    return SimpleNamespace(problem=problem, here=here, static=SimpleNamespace(root_of_covariance=lambda: root))


def found(priors) -> tuple[CostProfile, np.ndarray]:
    """And the posterior covariance of everything."""
    posed, n = problem(priors), len(priors)
    gaussian, here = GaussianPrior.of(posed.layout.error_priors), Quadratic(information(n, 2.0))

    def search(model, slope, held: GaussianPrior) -> tuple[np.ndarray, float]:
        whole, rhs = information(n, 1.0), np.append(np.full(n, SHOWN_S / SD_S**2), 0.0)
        whole[:n, :n] += held.precision
        rhs[:n] += held.pull
        static = np.linalg.solve(whole, rhs)
        return static, cost(static, n) + held.cost(static[:n])

    place = Place(search(None, None, gaussian)[0])
    profile = CostProfile.of(model_of(posed, here, gaussian), gaussian, place, search)
    root = model_of(posed, profile.here, profile.instruments).static.root_of_covariance()
    return profile, root @ root.T


def parts_of(prior: FaultMixture) -> list[tuple[float, float]]:
    return [(1.0 - prior.fault_probability, prior.nominal_sd), (prior.fault_probability, prior.faulty_sd)]


def integrated(parts) -> tuple[float, float]:
    """Mean and variance of the delay with a prior that is a sum of Gaussians: shares and deviations. What the cost
    shows is late by what soft tissue lags, too.
    """
    lag_s, lag_sd_s = LAG_S
    delay = np.linspace(-0.01, 0.02, 60001)
    prior = sum(share / sd * np.exp(-0.5 * (delay / sd) ** 2) for share, sd in parts)
    weight = prior * np.exp(-0.5 * ((delay + lag_s - SHOWN_S) / np.hypot(SD_S, lag_sd_s)) ** 2)
    mean = np.average(delay, weights=weight)
    return mean, np.average(np.square(delay - mean), weights=weight)


def test_mean_and_deviation_are_those_of_profile_and_prior_together():
    profile, covariance = found([CLOCK])
    mean, variance = integrated(parts_of(CLOCK))
    assert profile.static[0] == pytest.approx(mean, rel=1e-4)
    assert covariance[0, 0] == pytest.approx(variance, rel=1e-3)


def test_the_others_follow():
    profile, covariance = found([CLOCK])
    assert profile.static[1] == pytest.approx(FOLLOWS * profile.static[0], rel=1e-4)
    assert covariance[1, 1] == pytest.approx(BODY_SD**2 + FOLLOWS**2 * covariance[0, 0], rel=1e-3)


def test_what_one_trial_shows_may_be_the_clock_s_or_its_own():
    profile, covariance = found([CLOCK, OWN])
    both = [(a * b, np.hypot(c, d)) for a, c in parts_of(CLOCK) for b, d in parts_of(OWN)]
    mean, variance = integrated(both)
    assert profile.static[:2].sum() == pytest.approx(mean, rel=1e-4)
    assert covariance[:2, :2].sum() == pytest.approx(variance, rel=1e-3)
    assert 0.0 < profile.static[1] < 0.3 * profile.static[0]


def test_where_nothing_is_to_be_profiled_all_is_left_as_it_is():
    posed = problem([CLOCK])
    known = SimpleNamespace(**{**vars(posed), "profiled": list})
    gaussian, here = GaussianPrior.of(posed.layout.error_priors), Quadratic(information(1, 2.0))
    place = Place(np.zeros(2))
    model = model_of(known, here, gaussian)
    profile = CostProfile.of(model, gaussian, place, lambda model, slope, held: pytest.fail("searched"))
    assert profile.here is here
    assert profile.static is place.static


@pytest.mark.parametrize("count", [1, 2])
def test_they_are_more_unknowns_of_the_estimate(count):
    """Against the whole problem: data on x + D z, priors on x and z."""
    rng = np.random.default_rng(104)
    root, prior = rng.normal(size=(6, 4)), np.diag([1.0, 4.0, 2.0, 0.5])
    directions, measured = rng.normal(size=(4, count)), rng.normal(size=6)
    data = root.T @ root
    covariance = np.linalg.inv(prior + data)
    estimate = covariance @ root.T @ measured
    moved, more = with_left_out(directions, data @ directions, directions.T @ prior @ estimate, covariance)

    rows, apart = np.hstack([root, root @ directions]), np.zeros((4, count))
    whole = np.linalg.inv(rows.T @ rows + np.block([[prior, apart], [apart.T, np.eye(count)]]))
    np.testing.assert_allclose(estimate + moved, (whole @ rows.T @ measured)[:4], atol=1e-12)
    np.testing.assert_allclose(covariance + more @ more.T, whole[:4, :4], atol=1e-12)


def test_priors_that_are_next_to_exact_leave_nothing_negative():
    """As where body segment parameters are held: what the data would say of them is lost in rounding."""
    rng = np.random.default_rng(7)
    root, directions = rng.normal(size=(6, 4)) * 1e9, rng.normal(size=(4, 2))
    data = root.T @ root
    covariance = np.linalg.inv(data) * (1.0 + 1e-9)
    moved, more = with_left_out(directions, data @ directions, np.ones(2), covariance)
    assert np.isfinite(moved).all()
    assert np.isfinite(more).all()
