"""Fits a cohort on this computer, in one process per core: each works on one person at a time, with one thread."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Event, Thread

from kinertia.cohort.job import RETRIES, Finished, Job
from kinertia.cohort.process import PYTHON, Process

WORKER = (*PYTHON, "-m", "kinertia.cohort.worker")
PERSON_MEMORY_BYTES = 2 * 1024**3
"""Smallest memory of a fit: ten minutes of gait with plates at 1000 Hz need two thirds of it."""
_LOOK_S = 0.2
"""Interval between two looks at the memory."""


@dataclass(frozen=True)
class LocalSize:
    """Processes on this computer, and the memory (bytes) that each may take."""

    workers: int
    memory_bytes: int


def local_size(people: int) -> LocalSize:
    """Return the size for this computer: one process per core, fewer where memory or people do not suffice."""
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    workers = max(1, min(CPU_COUNT, MEMORY_LIMIT // PERSON_MEMORY_BYTES, people))
    return LocalSize(workers, MEMORY_LIMIT // workers)


def fit_here(jobs: Sequence[Job], size: LocalSize, command: Sequence[str] = WORKER) -> Iterator[Finished]:
    """Run the jobs and yield how each ended, in the order in which they end; whatever runs ends with the iterator.

    Args:
        jobs: jobs, one per person.
        size: number of processes, and memory of each: one that takes more is killed.
        command: starts a process that does as `kinertia.cohort.worker`.
    """
    waiting: SimpleQueue[Job] = SimpleQueue()
    for job in jobs:
        waiting.put(job)
    crew = _Crew(waiting, command)
    threads = [Thread(target=crew.work, daemon=True) for _ in range(min(size.workers, len(jobs)))]
    try:
        for thread in threads:
            thread.start()
        left = len(jobs)
        while left:
            crew.limit_memory(size.memory_bytes)
            try:
                ended = crew.ended.get(timeout=_LOOK_S)
            except Empty:
                continue
            if isinstance(ended, BaseException):
                raise ended
            yield ended
            left -= 1
    finally:
        crew.stop()
        for thread in threads:
            thread.join()


class _Crew:
    """Threads that each have a process fit one person after another.

    Attributes:
        ended: how jobs have ended, and what kept a thread from working.
    """

    def __init__(self, waiting: SimpleQueue[Job], command: Sequence[str]) -> None:
        self.ended: SimpleQueue[Finished | BaseException] = SimpleQueue()
        self._waiting = waiting
        self._command = command
        self._running: set[Process] = set()
        self._over = Event()

    def work(self) -> None:
        """Fit people until none are waiting."""
        try:
            with ExitStack() as opened:
                process = None
                while not self._over.is_set():
                    job = self._waiting.get_nowait()
                    answer = None
                    for _ in range(RETRIES + 1):
                        process = process or opened.enter_context(self._started())
                        process.ask(job.text)
                        answer = next(process.answers(), None)
                        if answer is not None or self._over.is_set():
                            break
                        process = None  # it was killed
                    self.ended.put(Finished(job.killed()) if answer is None else Finished.of(answer))
        except Empty:
            return
        except BaseException as error:
            self.ended.put(error)

    def _started(self) -> Process:
        process = Process(self._command)
        self._running.add(process)
        if self._over.is_set():
            process.kill()
        return process

    def limit_memory(self, most_bytes: int) -> None:
        """Kill processes that take more memory."""
        from psutil import NoSuchProcess
        from psutil import Process as Running  # Dask needs it, too

        for process in list(self._running):
            try:
                if Running(process.pid).memory_info().rss > most_bytes:
                    process.kill()
            except NoSuchProcess:
                continue

    def stop(self) -> None:
        """End all processes, and start no more."""
        self._over.set()
        for process in list(self._running):
            process.kill()
