"""Runs independent parts of a computation in two threads, if the machine has two cores for them.

Compiled functions, BLAS and NumPy's larger operations release the interpreter lock while they run. The division of the
work depends on the problem alone, never on the number of threads: results are equal bit for bit.
"""

import os
from collections.abc import Callable, Sequence
from contextvars import copy_context
from functools import cache
from multiprocessing import parent_process
from threading import Lock, Thread
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

THREAD = "kinertia"
"""Beginning of the name of the second thread."""
_second = Lock()
"""Lock of the second thread: there is never a third."""


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
