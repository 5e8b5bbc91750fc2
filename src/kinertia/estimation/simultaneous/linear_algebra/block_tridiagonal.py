"""Factorises and solves symmetric positive definite systems that are block tridiagonal with a dense border.

It provides the Cholesky factor, the solution and the Schur complement. Ordered by time, the spline coefficients of a
motion are coupled only to their neighbours, and all of them to the few unknowns that do not move. Work and memory grow
linearly with the number of blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.blas import (
    cholesky,
    solve_lower,
    solve_lower_from_right,
    subtract_product,
    subtract_square,
)
from kinertia.model.array_types import Float2, Float3
from kinertia.model.compiled import compiled_sums


@dataclass(frozen=True)
class BlockBand:
    """Lower Cholesky factor of a block tridiagonal matrix, or of its first b blocks.

    Attributes:
        diagonal: (b, k, k) lower triangular blocks on the diagonal.
        below: (b - 1, k, k) blocks below it; if the matrix continues, (b, k, k), the last being below the last of
            `diagonal`.
    """

    diagonal: np.ndarray
    below: np.ndarray

    @classmethod
    def factor(cls, diagonal: np.ndarray, below: np.ndarray, in_place: bool = False) -> BlockBand:
        """Factorise the matrix with these diagonal (b, k, k) and sub-diagonal (b - 1, k, k) blocks.

        There are (b, k, k) sub-diagonal blocks if the matrix continues. With `in_place` the blocks are overwritten.

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        factors, carried = (diagonal, below) if in_place else (diagonal.copy(), below.copy())
        for i, factor in enumerate(factors):
            if i:
                subtract_square(factor, carried[i - 1])
            cholesky(factor)
            if i < len(carried):
                solve_lower_from_right(factor, carried[i])
        return cls(factors, carried)

    @cached_property
    def _single(self) -> BlockBand:
        return BlockBand(self.diagonal.astype(np.float32), self.below.astype(np.float32))

    def as_precise(self, precision: np.dtype[np.floating] | type[np.floating]) -> BlockBand:
        """Return the factor in this precision, converted to single precision if requested."""
        return self._single if precision == np.float32 else self

    def forward(self, rhs: np.ndarray, in_place: bool = False) -> np.ndarray:
        """Solve L x = rhs; rhs is (b, k, m), of the factor's precision, and may be overwritten if `in_place`."""
        result = rhs if in_place else rhs.copy()
        if result.shape[2] == 1:
            _forward(self.diagonal, self.below, result[..., 0])
            return result
        for i in range(len(result)):
            if i:
                subtract_product(result[i], self.below[i - 1], result[i - 1])
            solve_lower(self.diagonal[i], result[i])
        return result

    def backward(self, rhs: np.ndarray, after: np.ndarray | None = None, in_place: bool = False) -> np.ndarray:
        """Solve L^T x = rhs (b, k, m); `after` (k, m) is the next block of the solution if the matrix continues."""
        result, known = rhs if in_place else rhs.copy(), after
        if result.shape[2] == 1:
            if known is not None and len(result):
                result[-1] -= self.below[len(result) - 1].T @ known
            _backward(self.diagonal, self.below, result[..., 0])
            return result
        for i in range(len(result) - 1, -1, -1):
            if known is not None:
                subtract_product(result[i], self.below[i], known, transposed=True)
            solve_lower(self.diagonal[i], result[i], transposed=True)
            known = result[i]
        return result


@compiled_sums
def _forward(diagonal: Float3, below: Float3, x: Float2) -> None:
    """Replace x (b, k) by L^-1 x. For a single column, calling BLAS would take six times as long."""
    for n in range(len(x)):
        own, before = x[n], x[n - 1]
        for i in range(len(own)):
            total = 0.0
            if n:
                for j in range(len(own)):
                    total += below[n - 1, i, j] * before[j]
            for j in range(i):
                total += diagonal[n, i, j] * own[j]
            own[i] = (own[i] - total) / diagonal[n, i, i]


@compiled_sums
def _backward(diagonal: Float3, below: Float3, x: Float2) -> None:
    """Replace x (b, k) by L^-T x."""
    for n in range(len(x) - 1, -1, -1):
        own = x[n]
        for i in range(len(own) if n + 1 < len(x) else 0):
            known = x[n + 1, i]
            for j in range(len(own)):
                own[j] -= below[n, i, j] * known
        for i in range(len(own) - 1, -1, -1):
            known = own[i] / diagonal[n, i, i]
            own[i] = known
            for j in range(i):
                own[j] -= diagonal[n, i, j] * known
