"""Fits a cohort on this computer, in one process per core: each works on one person at a time, with one thread.

The page (`cli.web`) and cohorts on this computer work this way: a crash, or files that hang a reader, affect no one
else, and cancelling ends the process.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import Any, Self

from kinertia.cohort.job import RETRIES, Finished, Job
from kinertia.io.file_names import PYTHON

_OF_ITS_OWN: dict[str, Any] = {"process_group": 0}
WORKER = (*PYTHON, "-m", "kinertia.cohort.worker")
PERSON_MEMORY_BYTES = 2 * 1024**3
"""Smallest memory of a fit: ten minutes of gait with plates at 1000 Hz need two thirds of it."""
_LOOK_S = 0.2
"""Interval between two looks at the memory."""


if sys.platform == "win32":
    _OF_ITS_OWN = {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
"""Windows opens a console for every process otherwise. Ctrl-C is for the process that waits, which ends the others."""


class Process:
    """A process that is asked by lines on its standard input, if at all, and answers on its standard output.

    >>> with Process([sys.executable, "-c", "print('{\\"share\\": 0.5}'); print('noise')"]) as process:
    ...     list(process.answers()), process.status()
    ([{'share': 0.5}], 0)
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            cwd=Path.home(),  # results replace their folder, which must be nobody's current one
            **_OF_ITS_OWN,
        )
        self.pid = self._process.pid
        self._log: list[str] = []
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        assert self._process.stderr is not None
        self._log.append(self._process.stderr.read())

    def ask(self, line: str) -> None:
        """Write a line to its standard input, unless it has ended."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def answers(self) -> Iterator[dict[str, Any]]:
        """Yield its answers until it ends; other output is left out."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                answer = json.loads(line)
            except ValueError:
                continue
            if isinstance(answer, dict):
                yield answer

    def kill(self) -> None:
        """End it at once; may be called from any thread."""
        self._process.kill()

    def status(self) -> int:
        """Wait until it has ended, and return its exit status."""
        return self._process.wait()

    @property
    def log(self) -> str:
        """Everything on its standard error, once it has ended."""
        self._listener.join()
        return "".join(self._log)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it, and free its pipes."""
        self.kill()
        self._process.wait()
        self._listener.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            with suppress(OSError):  # what it was asked and never read
                if pipe is not None:
                    pipe.close()


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
