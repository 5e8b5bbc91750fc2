import numpy as np
import pytest

from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation


@pytest.fixture
def singular_first() -> np.ndarray:
    """(9, 9) information, of which that on unknown 4 rounds to below zero; that on the last three is sound."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(12, 9)) * [1e6, 1.0, 1.0, 1e-3, 1.0, 1.0, 10.0, 1.0, 1.0]
    return factor.T @ factor


@pytest.mark.parametrize("n", [6, 9])
def test_root_gives_the_inverse(singular_first, n):
    """In units in which no standard deviation is above ten, as of all unknowns of the estimate."""
    units = np.where(np.arange(9) == 3, 1e3, 1.0)
    information = units[:, None] * singular_first * units
    root = StaticInformation.of(information, n).root_of_covariance()
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(information), rtol=1e-6, atol=1e-12)


def test_no_direction_is_less_certain_than_by_its_prior():
    """Information that rounds below that of the prior, 0.01, is a rounding error, and said to be one."""
    information = np.diag([100.0, 4.0, -1e-3])
    information[0, 1] = information[1, 0] = 10.0
    found = StaticInformation.of(information + 1e-9 * np.eye(3), 3)
    assert found.is_rounded
    root = found.root_of_covariance()
    assert np.abs(root @ root.T).max() < 101.0
    assert not StaticInformation.of(np.diag([100.0, 4.0, 0.02]), 3).is_rounded


def test_first_unknowns_alone_are_those_of_all_together(singular_first):
    information = StaticInformation.of(singular_first, 6)
    rhs, covariance = np.arange(9.0), np.linalg.inv(singular_first)[:6, :6]
    np.testing.assert_allclose(information.solution(rhs)[:6], np.linalg.solve(singular_first, rhs)[:6], rtol=1e-8)
    np.testing.assert_allclose(np.linalg.inv(information.first), covariance, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(information.covariance_of(slice(2, 5)), covariance[2:5, 2:5], rtol=1e-8, atol=1e-14)


@pytest.mark.parametrize("n", [3, 6])
@pytest.mark.parametrize("alike", [False, True], ids=["numbers alike", "as sure alike"])
def test_solution_of_all_unknowns(singular_first, n, alike):
    """No worse than rounding the right-hand side makes it, each unknown in units of its deviation.

    In these the condition number is 81 and not 9e17, the least that units can make of it within a factor of nine. Where
    the unknowns are as large in their own units, the first is a million times surer than most others, and rounding
    what it contributes to their equations moves these by 1e-9 (the fourth by 1e-6), however exactly one solves them.
    """
    unit = 1.0 / np.sqrt(np.diag(singular_first))
    solution = (np.arange(9.0) - 4.0) * (unit if alike else 1.0)
    found = StaticInformation.of(singular_first, n).solution(singular_first @ solution)
    condition = np.linalg.cond(unit[:, None] * singular_first * unit)
    assert condition < 100.0
    rounding = np.finfo(float).eps * condition * np.linalg.norm(solution / unit)
    assert np.abs((found - solution) / unit).max() < rounding


def test_singular_information_has_a_covariance():
    """At the edge of what is possible the information on a logarithm rounds to zero, or below."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(8, 8)) * [1e6, 1.0, 1.0, 1e-3, 1.0, 1.0, 1.0, 1.0]
    factor[:, 4] = factor[:, 5] * (1.0 + 1e-12)
    singular = factor.T @ factor - 1e-12 * np.outer(np.arange(8) == 4, np.arange(8) == 4)
    assert np.linalg.eigvalsh(singular)[0] < 0
    assert np.isfinite(StaticInformation.of(singular, 6).root_of_covariance()).all()
