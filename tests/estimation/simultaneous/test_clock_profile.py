from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.clock_profile import ClockProfile
from kinertia.estimation.simultaneous.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.linearised import Point
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior, SoundOrFaulty
from small_problem import small_problem

MIXED = SoundOrFaulty(0.002, 0.02, 0.3)


def with_clock(prior: SoundOrFaulty) -> MapProblem:
    one = small_problem()
    calibration = replace(one.calibration, instruments=replace(one.calibration.instruments, clock_s=prior))
    return MapProblem(one.skeleton, one.prior, calibration, one.trials)


def lowest(problem: MapProblem, point: Point, gaussian: GaussianPrior, steps: int = 12) -> Point:
    """Gauss-Newton steps, halved until they lower the cost."""
    for _ in range(steps):
        here = problem.at(point)
        model = GaussNewton.of(problem, here, problem.bends(here.point.like(here.slope.right).static)).under(gaussian)
        cost, right = here.slope.under(gaussian)
        step = model.step(right)
        for share in 0.5 ** np.arange(8):
            there = point.like(point.vector + problem.shortened(point, share * step))
            if problem.slope(there).under(gaussian)[0] < cost:
                point = there
                break
    return point


@pytest.fixture(scope="module")
def mixed():
    problem = with_clock(MIXED)
    gaussian = GaussianPrior.of(problem.instruments)
    return problem, gaussian, lowest(problem, problem.beginning, gaussian)


def profile(mixed, search=None):
    problem, gaussian, point = mixed
    search = search or (lambda model, held: lowest(problem, point, held, 6))
    return ClockProfile.of(problem, problem.at(point), gaussian, point, search)


def test_mean_and_deviation_are_those_of_profile_and_prior_together(mixed):
    problem, gaussian, point = mixed
    found, clock = profile(mixed), problem.layout.clock
    own = clock - problem.layout.instruments.start
    variance = covariance(problem, found)[clock, clock]

    sd = np.sqrt(variance)
    delays = point.static[clock] + sd * np.linspace(-3.5, 3.5, 15)
    costs = []
    for at in delays:
        precision, pull = gaussian.precision.copy(), gaussian.pull.copy()
        precision[own, own], pull[own] = 1e12, 1e12 * at
        there = lowest(problem, point, GaussianPrior(precision, pull), 6)
        values = there.static[problem.layout.instruments]
        others = gaussian.cost(values) - 0.5 * gaussian.precision[own, own] * at**2 + gaussian.pull[own] * at
        costs.append(problem.slope(there).cost + others)
    fine = np.linspace(delays[0], delays[-1], 4001)
    cost = np.polynomial.Polynomial.fit(delays, np.array(costs) - min(costs), 4)(fine)
    weight = np.exp(-cost) * sum(
        share / own_sd * np.exp(-0.5 * (fine / own_sd) ** 2)
        for share, own_sd in ((1.0 - MIXED.faulty_share, MIXED.sound_sd), (MIXED.faulty_share, MIXED.faulty_sd))
    )
    mean = np.average(fine, weights=weight)
    assert found.static[clock] == pytest.approx(mean, abs=0.1 * sd)
    assert sd == pytest.approx(np.sqrt(np.average(np.square(fine - mean), weights=weight)), rel=0.1)


def covariance(problem: MapProblem, found: ClockProfile) -> np.ndarray:
    root = GaussNewton.of(problem, found.here).under(found.instruments).static.root_of_covariance()
    return root @ root.T


def test_the_others_follow_the_clock(mixed):
    problem, gaussian, point = mixed
    found, clock = profile(mixed), problem.layout.clock
    root = GaussNewton.of(problem, problem.at(point)).under(gaussian).static.root_of_covariance()
    gain = root @ root[clock] / (root[clock] @ root[clock])
    moved = found.static - point.static
    np.testing.assert_allclose(moved, gain * moved[clock], atol=1e-9)


def test_a_clock_that_has_been_checked_is_left_as_it_is():
    problem = with_clock(SoundOrFaulty.certain(0.01))
    gaussian, point = GaussianPrior.of(problem.instruments), problem.beginning
    here = problem.at(point)
    found = ClockProfile.of(problem, here, gaussian, point, lambda model, held: pytest.fail("searched"))
    assert found.here is here
    assert found.instruments is gaussian
    np.testing.assert_array_equal(found.static, point.static)
