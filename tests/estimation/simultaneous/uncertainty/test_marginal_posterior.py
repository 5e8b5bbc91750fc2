from dataclasses import replace

import numpy as np
import pytest

from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import Point
from kinertia.estimation.simultaneous.uncertainty.marginal_posterior import PHASES, OfPhases, followed
from small_problem import point, small_problem
from validation.study_bound import dense_band


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def here(problem):
    coefficients, static = point(problem)
    return Point(tuple(coefficients), static, problem.beginning.displaced)


def test_what_does_not_move_is_averaged_and_the_distance_is_in_its_covariance(problem, here):
    away = np.random.default_rng(100).normal(size=len(here.static))
    found = OfPhases.of(problem, here, lambda other, begin: replace(begin, static=begin.static + away))
    n = 1 + len(PHASES)
    np.testing.assert_allclose(found.static, here.static + away * (n - 1) / n)
    variance = away**2 * (n - 1) / n / (n - 1) / n
    np.testing.assert_allclose(np.diag(found.covariance), variance)


def test_other_phases_begin_with_the_same_motion(problem, here):
    found = OfPhases.of(problem, here, lambda other, begin: begin)
    motions = [
        p.bases[0].evaluate(found_point.coefficients[0])[0]
        for p, found_point in zip(found.problems, found.points, strict=True)
    ]
    assert found.problems[1].bases[0].knots[0] < problem.bases[0].knots[0]
    assert np.sqrt(np.mean(np.square(motions[1] - motions[0]))) < 0.5 * np.sqrt(np.mean(np.square(motions[0])))
    assert not found.covariance.any()


def test_curves_of_the_same_motion_and_body_are_not_apart(problem, here):
    found = OfPhases.of(problem, here, lambda other, begin: begin)
    same = replace(found, problems=(problem, problem), points=(here, here)).curves_apart(0)
    assert not same.moments.any()
    heavier = here.static.copy()
    heavier[problem.layout[BSP].start] += 0.1
    apart = replace(found, problems=(problem, problem), points=(here, replace(here, static=heavier))).curves_apart(0)
    assert apart.moments.max() > 0.0
    assert not apart.coordinates.any()


def test_the_motion_follows_what_does_not_move_to_where_its_quadratic_is_lowest(problem, here):
    model = GaussNewton.of(problem, problem.at(here))
    step = np.random.default_rng(100).normal(0.0, 1e-3, len(here.static))
    moved = followed(model, here, here.static + step)
    normal = problem.normal(0, here.coefficients[0], here.static)
    motion = (moved.coefficients[0] - here.coefficients[0]).ravel()
    pulled = normal.border.reshape(len(motion), -1) @ step
    np.testing.assert_allclose(dense_band(normal.band) @ motion, -pulled, atol=1e-3 * np.abs(pulled).max())
