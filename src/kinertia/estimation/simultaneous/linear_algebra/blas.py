"""Factorises, solves and multiplies matrices in place, with the BLAS and LAPACK of SciPy.

SciPy's own wrappers hold the global interpreter lock while they run; these release it for other threads. Matrices are
row-major (C order) and of one precision; BLAS reads them column-major, as their transposes.
"""

import ctypes
from collections.abc import Callable
from functools import cache, lru_cache

import numpy as np

_Argument = np.ndarray | bytes | int | float


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
    arrays = [each for each in arguments if isinstance(each, np.ndarray) and each.dtype.kind == "f"]
    precision = arrays[0].dtype
    assert all(each.flags.c_contiguous and each.dtype == precision for each in arrays)
    letter = "s" if precision == np.float32 else "d"
    _routine(letter + name, len(arguments))(*(_address(each, letter) for each in arguments))


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
