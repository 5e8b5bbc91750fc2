"""Limits BLAS to one thread for computations on small matrices, as a body's are.

Threads cost twice what they give there, and ten times on a busy machine. What computes for longer than a moment is
decorated with `one_blas_thread`, each step on its own, so that it holds for whoever calls them one by one; the user's
setting is back afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")

_held = False


@cache
def _libraries() -> ThreadpoolController:
    """Those of NumPy and SciPy: to look for them takes as long as some of what they are held for."""
    import scipy.linalg  # noqa: F401  # brings its own

    return ThreadpoolController()


def one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """The same function, during which BLAS has one thread; within another such function nothing is left to do."""

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
