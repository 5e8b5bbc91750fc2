"""Limits BLAS to one thread for computations on small matrices, such as those of a body.

More threads would double the time, or multiply it by ten on a busy machine. Functions that compute for longer than a
moment are decorated with `one_blas_thread`, each step separately, so that it also applies to callers of single steps;
the user's setting is restored afterwards.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")

_held = False


@cache
def _libraries() -> ThreadpoolController:
    """Return the BLAS libraries of NumPy and SciPy: finding them takes as long as some of the computations."""
    import scipy.linalg  # noqa: F401  # brings its own

    return ThreadpoolController()


def one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Wrap a function so that BLAS has one thread while it runs; nested wrappers have no further effect."""

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        global _held
        if _held:
            return function(*args, **kwargs)
        _held = True
        try:
            with _libraries().limit(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        finally:
            _held = False

    return limited
