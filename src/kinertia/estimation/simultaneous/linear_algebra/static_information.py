"""Eliminates unknowns that only markers depend on from the information on the static unknowns.

They are many, and always have a prior. The remaining unknowns, body and calibration, may come near the limit of what is
physically possible, where the logarithm of a second moment becomes undetermined and its information may round to below
zero.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.linalg import cholesky, lu_factor, lu_solve, solve_triangular

LEAST_INFORMATION = 0.01
"""On every unknown by its prior, so that none has a standard deviation above ten. Where the data favour a second moment
below zero, its logarithm falls until neither data nor prior hold it; what is computed from its variance is then noise,
and its exponential may have any size."""
_ROUNDED = 0.5
"""Share of that."""


@dataclass(frozen=True)
class StaticInformation:
    """Information on S unknowns with the last k eliminated.

    Attributes:
        first: (n, n) on the first n (Schur complement).
        factor: (k, k) lower Cholesky factor L of the information on the last k alone.
        across: (k, n) L^-1 times the block between them.

    >>> found = StaticInformation.of(np.array([[3.0, 1.0], [1.0, 2.0]]), 1)
    >>> found.first
    array([[2.5]])
    >>> np.round(found.solution(np.array([5.0, 5.0])), 3)
    array([1., 2.])
    >>> root = found.root_of_covariance()
    >>> np.round(root @ root.T, 3)
    array([[ 0.4, -0.2],
           [-0.2,  0.6]])
    """

    first: np.ndarray
    factor: np.ndarray
    across: np.ndarray

    @classmethod
    def of(cls, information: np.ndarray, n: int) -> Self:
        """Eliminate all but the first n unknowns from the information (S, S).

        Raises:
            numpy.linalg.LinAlgError: the information on the others is not positive definite.
        """
        factor = cholesky(information[n:, n:], lower=True)
        across = solve_triangular(factor, information[n:, :n], lower=True)
        return cls(information[:n, :n] - across.T @ across, factor, across)

    @cached_property
    def _directions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information (n,) along n independent directions, the least that priors allow there, and the directions."""
        scale = 1.0 / np.sqrt(np.maximum(np.diag(self.first), LEAST_INFORMATION))
        values, vectors = np.linalg.eigh(scale[:, None] * self.first * scale)
        directions = scale[:, None] * vectors
        return values, LEAST_INFORMATION * np.square(directions).sum(axis=0), directions

    @property
    def is_rounded(self) -> bool:
        """Rounding took more information than there is in some direction, where precise data show almost nothing."""
        values, least, _ = self._directions
        return bool((values < _ROUNDED * least).any())

    @cached_property
    def _factored(self) -> tuple[np.ndarray, np.ndarray]:
        factors: tuple[np.ndarray, np.ndarray] = lu_factor(self.first)
        return factors

    def solution(self, rhs: np.ndarray) -> np.ndarray:
        """Solve the normal equations for a right-hand side (S,); returns all unknowns (S,)."""
        n = len(self.first)
        half = solve_triangular(self.factor, rhs[n:], lower=True)
        first = lu_solve(self._factored, rhs[:n] - self.across.T @ half)
        last = solve_triangular(self.factor, half - self.across @ first, lower=True, trans="T")
        return np.concatenate([first, last])

    def covariance_of(self, some: slice) -> np.ndarray:
        """Return the covariance (m, m) of some of the first n unknowns."""
        result: np.ndarray = lu_solve(self._factored, np.eye(len(self.first))[:, some])[some]
        return result

    def root_of_covariance(self) -> np.ndarray:
        """Return R (S, S) with covariance R R^T of all unknowns; in no direction is it larger than by priors alone."""
        return self._root

    @cached_property
    def _root(self) -> np.ndarray:
        n, k = len(self.first), len(self.factor)
        values, least, directions = self._directions
        result = np.zeros((n + k, n + k))
        result[:n, :n] = directions / np.sqrt(np.maximum(values, least))
        result[n:, n:] = np.eye(k)
        result[n:, :n] = -self.across @ result[:n, :n]
        result[n:] = solve_triangular(self.factor, result[n:], lower=True, trans="T")
        return result
