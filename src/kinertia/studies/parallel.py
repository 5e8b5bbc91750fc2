"""Runs independent work in parallel processes; results do not depend on their number."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context, resource_tracker
from types import FrameType
from typing import TypeVar

from threadpoolctl import threadpool_limits

_MOST_ON_WINDOWS = 61
"""More than these handles cannot be waited for there: `ProcessPoolExecutor` raises ValueError."""

Case = TypeVar("Case")
Result = TypeVar("Result")


def in_parallel(
    task: Callable[[Case], Result],
    cases: Sequence[Case],
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Result]:
    """`task` of every case, in the order of the cases.

    Args:
        task: a function of a module, so that another process can import it.
        cases: each with all that its result depends on, seeds included.
        workers: processes; as many as there are cores if None.
        progress: called with the share that is done.
    """
    workers = process_count(workers, len(cases))
    progress(0.0)
    # spawned, because a forked copy of a process that has threads (a progress bar, linear algebra) may hang
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_one_thread)
    try:
        with interrupted_later():
            futures = [pool.submit(task, case) for case in cases]
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            progress(done / len(cases))
        return [future.result() for future in futures]
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def interrupted_later() -> Iterator[None]:
    """Ctrl-C waits until processes have what they start from: of its lack they would complain with tracebacks.

    A terminal sends it to them, too: those of POSIX that are started here never get it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[tuple[int, FrameType | None]] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: caught.append((number, frame)))
    let_through: set[int] = set()
    if sys.platform != "win32":  # what threads and processes inherit that are started meanwhile
        resource_tracker.ensure_running()  # which lets Ctrl-C through to whoever starts it
        let_through |= {signal.SIGINT} - signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if sys.platform != "win32":
            signal.pthread_sigmask(signal.SIG_UNBLOCK, let_through)
        signal.signal(signal.SIGINT, before)
    if caught and callable(before):
        before(*caught[0])


def process_count(wanted: int | None, cases: int) -> int:
    """How many processes to start: as wanted, or one per core; never more than cases, nor than the system can await."""
    most = _MOST_ON_WINDOWS if sys.platform == "win32" else cases
    return max(1, min(wanted or os.cpu_count() or 1, cases, most))


def _one_thread() -> None:
    """Matrices here are small: threads of the linear algebra library would only get into each other's way.

    Ctrl-C is for the process that waits.
    """
    import scipy.linalg  # noqa: F401  # the libraries of NumPy and SciPy: only what is loaded can be limited

    threadpool_limits(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
