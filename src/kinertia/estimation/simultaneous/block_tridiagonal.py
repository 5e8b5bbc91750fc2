"""Symmetric positive definite systems that are block tridiagonal with a dense border: Cholesky, solution, Schur
complement.

Ordered by time, the spline coefficients of a motion see only their neighbours, and all of them see the few unknowns
that do not move. Work and memory grow linearly with the number of blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dgemm, dtrsm
from scipy.linalg.lapack import dpotrf


@dataclass(frozen=True)
class BlockBand:
    """Lower Cholesky factor of a block tridiagonal matrix, or of its first b blocks.

    Attributes:
        diagonal: (b, k, k) lower triangular blocks on the diagonal.
        below: (b - 1, k, k) blocks below it; where the matrix goes on, (b, k, k), the last being below the last of
            `diagonal`.
    """

    diagonal: np.ndarray
    below: np.ndarray

    @classmethod
    def factor(cls, diagonal: np.ndarray, below: np.ndarray) -> BlockBand:
        """Factor the matrix with these diagonal (b, k, k) and sub-diagonal (b - 1, k, k) blocks, or (b, k, k) where it
        goes on.

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        factors, carried = np.empty_like(diagonal), np.empty_like(below)
        for i in range(len(diagonal)):
            left = diagonal[i] - carried[i - 1] @ carried[i - 1].T if i else diagonal[i]
            factors[i] = _cholesky(left)
            if i < len(below):
                carried[i] = _times_inverse_transpose(factors[i], below[i])
        return cls(factors, carried)

    def forward(self, right: np.ndarray) -> np.ndarray:
        """Solve L x = right; right is (b, k, m)."""
        result = right.copy()
        for i in range(len(result)):
            if i:
                _subtract_product(result[i], self.below[i - 1], result[i - 1])
            _solve_in_place(self.diagonal[i], result[i])
        return result

    def backward(self, right: np.ndarray, after: np.ndarray | None = None) -> np.ndarray:
        """Solve L^T x = right; right is (b, k, m), and `after` (k, m) the solution's next block where it goes on."""
        result, known = right.copy(), after
        for i in range(len(result) - 1, -1, -1):
            if known is not None:
                _subtract_product(result[i], self.below[i].T, known)
            _solve_in_place(self.diagonal[i], result[i], transposed=True)
            known = result[i]
        return result

    def inverse_blocks(self, after: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Blocks of the inverse on the diagonal (b, k, k) and below it, as many as of `below`, by Takahashi's
        recursion; `after` (k, k) is the next block on its diagonal where the matrix goes on.
        """
        diagonal, below, next_one = np.empty_like(self.diagonal), np.empty_like(self.below), after
        unit = np.eye(self.diagonal.shape[1])
        for i in range(len(diagonal) - 1, -1, -1):
            half = unit.copy()
            _solve_in_place(self.diagonal[i], half)
            diagonal[i] = half.T @ half
            if next_one is not None:
                carried = self.below[i] @ half
                below[i] = -next_one @ carried
                diagonal[i] -= carried.T @ below[i]
            next_one = diagonal[i]
        return diagonal, below


# BLAS and LAPACK take matrices column by column: a row-wise matrix is its own transpose there, and is not copied


def _cholesky(matrix: np.ndarray) -> np.ndarray:
    factor, failed = dpotrf(matrix.T, lower=0, clean=1)
    if failed:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    result: np.ndarray = factor.T
    return result


def _solve_in_place(lower: np.ndarray, right: np.ndarray, transposed: bool = False) -> None:
    """L^-1 right, or L^-T right, in the place of `right`, whose rows must lie one after the other."""
    dtrsm(1.0, lower.T, right.T, side=1, lower=0, trans_a=int(transposed), overwrite_b=1)


def _subtract_product(target: np.ndarray, left: np.ndarray, right: np.ndarray) -> None:
    """Take left @ right off the target, in its place; its rows must lie one after the other."""
    dgemm(-1.0, right.T, left.T, beta=1.0, c=target.T, overwrite_c=1)


def _times_inverse_transpose(lower: np.ndarray, left: np.ndarray) -> np.ndarray:
    """left L^-T."""
    result: np.ndarray = dtrsm(1.0, lower.T, left.T, side=0, lower=0, trans_a=1).T
    return result
