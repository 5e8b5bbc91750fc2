"""Runs independent work in parallel processes; results do not depend on their number."""

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

from kinertia.motion.workload import in_one_thread

_SAFE_PATH = "PYTHONSAFEPATH"
_MOST_ON_WINDOWS = 61
"""Largest number of handles that Windows can wait for: `ProcessPoolExecutor` raises ValueError above it."""

Case = TypeVar("Case")
Result = TypeVar("Result")


def in_parallel(
    task: Callable[[Case], Result],
    cases: Sequence[Case],
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Result]:
    """Apply `task` to every case, and return the results in the order of the cases.

    Args:
        task: a function of a module, so that another process can import it.
        cases: each with everything that its result depends on, including seeds.
        workers: processes; as many as there are cores if None.
        progress: called with the share that is done.
    """
    workers = process_count(workers, len(cases))
    progress(0.0)
    # spawned, because a forked copy of a process that has threads (a progress bar, linear algebra) may hang
    with _safe_path():
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=one_thread)
    try:
        with _safe_path(), interrupted_later():
            futures = [pool.submit(task, case) for case in cases]
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            progress(done / len(cases))
        return [future.result() for future in futures]
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _safe_path() -> Iterator[None]:
    """Start processes that import nothing from the current folder."""
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


@contextmanager
def interrupted_later() -> Iterator[None]:
    """Delay Ctrl-C until started processes have their start data; without it they would end with tracebacks.

    A terminal sends Ctrl-C to them, too: those started here on POSIX never receive it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[tuple[int, FrameType | None]] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: caught.append((number, frame)))
    let_through: set[int] = set()
    if sys.platform != "win32":  # inherited by threads and processes that are started meanwhile
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
    """Return the number of processes: as wanted, or one per core; at most as many as cases or the system allows."""
    most = _MOST_ON_WINDOWS if sys.platform == "win32" else cases
    return max(1, min(wanted or os.cpu_count() or 1, cases, most))


def one_thread() -> None:
    """Keep this process to one thread, since matrices are small and others use the other cores, and ignore Ctrl-C.

    Ctrl-C is handled by the waiting process.
    """
    import scipy.linalg  # noqa: F401  # the libraries of NumPy and SciPy: only loaded ones can be limited

    threadpool_limits(1)
    in_one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
