"""Factorises and solves symmetric positive definite systems that are block tridiagonal with a dense border.

It provides the Cholesky factor, the solution and the Schur complement. Ordered by time, the spline coefficients of a
motion are coupled only to their neighbours, and all of them to the few unknowns that do not move. Work and memory grow
linearly with the number of blocks.

SciPy's own wrappers hold the global interpreter lock while they run; these release it for other threads. Matrices are
row-major (C order) and of one precision; BLAS reads them column-major, as their transposes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np

from kinertia.model.compiled import Float2, Float3, compiled_sums

_Argument = np.ndarray | bytes | int | float


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
        block, before = x[n], x[n - 1]
        for i in range(len(block)):
            total = 0.0
            if n:
                for j in range(len(block)):
                    total += below[n - 1, i, j] * before[j]
            for j in range(i):
                total += diagonal[n, i, j] * block[j]
            block[i] = (block[i] - total) / diagonal[n, i, i]


@compiled_sums
def _backward(diagonal: Float3, below: Float3, x: Float2) -> None:
    """Replace x (b, k) by L^-T x."""
    for n in range(len(x) - 1, -1, -1):
        block = x[n]
        for i in range(len(block) if n + 1 < len(x) else 0):
            known = x[n + 1, i]
            for j in range(len(block)):
                block[j] -= below[n, i, j] * known
        for i in range(len(block) - 1, -1, -1):
            known = block[i] / diagonal[n, i, i]
            block[i] = known
            for j in range(i):
                block[j] -= diagonal[n, i, j] * known


def cholesky(matrix: np.ndarray) -> None:
    """Replace a symmetric matrix (k, k) by its lower Cholesky factor L.

    Raises:
        numpy.linalg.LinAlgError: the matrix is not positive definite.
    """
    k, failed = len(matrix), np.zeros(1, np.int32)
    _call("potrf", b"U", k, matrix, k, failed)
    if failed[0]:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    matrix[_above(k)] = 0.0


def solve_lower(lower: np.ndarray, rhs: np.ndarray, transposed: bool = False) -> None:
    """Replace a right-hand side (k, m) by L^-1 times it, or by L^-T times it if `transposed`."""
    k, m = rhs.shape
    _call("trsm", b"R", b"U", b"T" if transposed else b"N", b"N", m, k, 1.0, lower, k, rhs, m)


def solve_lower_from_right(lower: np.ndarray, left: np.ndarray) -> None:
    """Replace a matrix A (m, k) by A L^-T."""
    m, k = left.shape
    _call("trsm", b"L", b"U", b"T", b"N", k, m, 1.0, lower, k, left, k)


def subtract_square(target: np.ndarray, factor: np.ndarray) -> None:
    """Subtract F F^T of a factor (k, m) from the lower half of a matrix (k, k)."""
    k, m = factor.shape
    _call("syrk", b"U", b"T", k, m, -1.0, factor, m, 1.0, target, k)


def subtract_product(target: np.ndarray, left: np.ndarray, rhs: np.ndarray, transposed: bool = False) -> None:
    """Subtract A B, or A^T B if `transposed`, from a matrix (k, m); B is (n, m)."""
    (k, m), n = target.shape, len(rhs)
    _call("gemm", b"N", b"T" if transposed else b"N", m, k, n, -1.0, rhs, m, left, left.shape[1], 1.0, target, m)


def _call(name: str, *arguments: _Argument) -> None:
    arrays = [argument for argument in arguments if isinstance(argument, np.ndarray) and argument.dtype.kind == "f"]
    precision = arrays[0].dtype
    assert all(array.flags.c_contiguous and array.dtype == precision for array in arrays)
    letter = "s" if precision == np.float32 else "d"
    _routine(letter + name, len(arguments))(*(_address(argument, letter) for argument in arguments))


def _address(argument: _Argument, letter: str) -> int:
    return argument.ctypes.data if isinstance(argument, np.ndarray) else ctypes.addressof(_kept(argument, letter))


@lru_cache(maxsize=None, typed=True)
def _kept(value: bytes | int | float, letter: str) -> ctypes.c_char | ctypes.c_int | ctypes.c_float | ctypes.c_double:
    """Wrap a flag, a size or a factor for Fortran."""
    if isinstance(value, bytes):
        return ctypes.c_char(value)
    if isinstance(value, int):
        return ctypes.c_int(value)
    return ctypes.c_float(value) if letter == "s" else ctypes.c_double(value)


@cache
def _above(k: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(k, 1)


@cache
def _routine(name: str, arguments: int) -> Callable[..., None]:
    from numba.extending import get_cython_function_address

    module = "scipy.linalg.cython_lapack" if name.endswith("potrf") else "scipy.linalg.cython_blas"
    prototype = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)
    return prototype(get_cython_function_address(module, name))
