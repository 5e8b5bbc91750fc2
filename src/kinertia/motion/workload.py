"""Divides computations: two threads, one thread of BLAS, and chunks of frames to limit memory.

Compiled functions, BLAS and NumPy's larger operations release the interpreter lock while they run. The division of the
work depends on the problem alone, never on the number of threads: results are equal bit for bit.

The intermediate results of a frame (axes, derivatives, rows of equations) are a hundred times larger than its
coordinates, and in a long trial never fit into memory together.

More threads would double the time, or multiply it by ten on a busy machine. Functions that compute for longer than a
moment are decorated with `one_blas_thread`, each step separately, so that it also applies to callers of single steps;
the user's setting is restored afterwards.
"""

import os
from collections.abc import Callable, Sequence
from contextvars import copy_context
from functools import cache, wraps
from multiprocessing import parent_process
from threading import Lock, Thread
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
R = TypeVar("R")
THREAD = "kinertia"
"""Beginning of the name of the second thread."""
_second = Lock()
"""Lock of the second thread: there is never a third."""
FRAMES_AT_ONCE = 2000
"""Few enough to take some tens of MB, and enough that the calls take no noticeable time."""
P = ParamSpec("P")
_held = False


def side_by_side(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Apply a function to every item: the first half here, the others in a second thread if there is a core for it.

    >>> side_by_side(abs, [-3, 2, -1])
    [3, 2, 1]
    """
    if len(items) < 2:
        return [function(item) for item in items]
    middle = (len(items) + 1) // 2
    here, there = both(
        lambda: [function(item) for item in items[:middle]], lambda: [function(item) for item in items[middle:]]
    )
    return here + there


def both(first: Callable[[], T], second: Callable[[], R]) -> tuple[T, R]:
    """Call two functions: the first here, the other in a second thread if there is a core for it.

    >>> both(lambda: 1, lambda: "a")
    (1, 'a')
    """
    if cores() < 2 or not _second.acquire(blocking=False):
        return first(), second()
    there: list[R] = []
    failed: list[BaseException] = []

    def in_thread() -> None:
        try:
            there.append(second())
        except BaseException as error:
            failed.append(error)
        finally:
            _second.release()

    thread = Thread(target=copy_context().run, args=(in_thread,), name=THREAD, daemon=True)
    try:
        thread.start()
    except RuntimeError:  # no thread can be started
        _second.release()
        return first(), second()
    try:
        here = first()
    except Exception:
        thread.join()
        raise
    # an interruption waits for nothing
    thread.join()
    if failed:
        raise failed[0]
    return here, there[0]


def in_one_thread() -> None:
    """Start no second thread in this process from now on, since other processes use the other cores."""
    _second.acquire(blocking=False)


@cache
def cores() -> int:
    """Return the number of cores that this process may use; one in a child process, which shares the machine."""
    if parent_process() is not None:
        return 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def pieces(count: int, most: int = FRAMES_AT_ONCE) -> list[slice]:
    """Split `count` frames into slices of at most `most`."""
    return [slice(start, min(start + most, count)) for start in range(0, count, most)]


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
