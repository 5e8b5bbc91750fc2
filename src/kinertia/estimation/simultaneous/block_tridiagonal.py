"""Symmetric positive definite systems that are block tridiagonal with a dense border: Cholesky, solution, Schur
complement.

Ordered by time, the spline coefficients of a motion see only their neighbours, and all of them see the few unknowns
that do not move. Work and memory grow linearly with the number of blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular


@dataclass(frozen=True)
class BlockBand:
    """Lower Cholesky factor of a block tridiagonal matrix.

    Attributes:
        diagonal: (b, k, k) lower triangular blocks on the diagonal.
        below: (b - 1, k, k) blocks below it.
    """

    diagonal: np.ndarray
    below: np.ndarray

    @classmethod
    def factor(cls, diagonal: np.ndarray, below: np.ndarray) -> BlockBand:
        """Factor the matrix with these diagonal (b, k, k) and sub-diagonal (b - 1, k, k) blocks.

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        factors, carried = np.empty_like(diagonal), np.empty_like(below)
        factors[0] = np.linalg.cholesky(diagonal[0])
        for i in range(1, len(diagonal)):
            carried[i - 1] = solve_triangular(factors[i - 1], below[i - 1].T, lower=True, check_finite=False).T
            factors[i] = np.linalg.cholesky(diagonal[i] - carried[i - 1] @ carried[i - 1].T)
        return cls(factors, carried)

    def forward(self, right: np.ndarray) -> np.ndarray:
        """Solve L x = right; right is (b, k, m)."""
        result = np.empty_like(right)
        for i in range(len(right)):
            known = right[i] if i == 0 else right[i] - self.below[i - 1] @ result[i - 1]
            result[i] = solve_triangular(self.diagonal[i], known, lower=True, check_finite=False)
        return result

    def backward(self, right: np.ndarray) -> np.ndarray:
        """Solve L^T x = right; right is (b, k, m)."""
        result = np.empty_like(right)
        last = len(right) - 1
        for i in range(last, -1, -1):
            known = right[i] if i == last else right[i] - self.below[i].T @ result[i + 1]
            result[i] = solve_triangular(self.diagonal[i], known, lower=True, trans="T", check_finite=False)
        return result

    def inverse_blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """Blocks of the inverse on the diagonal (b, k, k) and below it (b - 1, k, k), by Takahashi's recursion."""
        diagonal, below = np.empty_like(self.diagonal), np.empty_like(self.below)
        unit = np.eye(self.diagonal.shape[1])
        for i in range(len(diagonal) - 1, -1, -1):
            half = solve_triangular(self.diagonal[i], unit, lower=True, check_finite=False)
            if i == len(diagonal) - 1:
                diagonal[i] = half.T @ half
                continue
            carried = self.below[i] @ half
            below[i] = -diagonal[i + 1] @ carried
            diagonal[i] = half.T @ half - carried.T @ below[i]
        return diagonal, below
