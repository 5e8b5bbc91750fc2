"""Starts the processes that fit a cohort: Dask's, on this computer or on a running cluster (SLURM: `slurm`).

What is to be done where, and again where a process was killed, is Dask's to say. One process works on one person at a
time, with one thread of the linear algebra library, as Dask sets it for its workers.
"""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any
from uuid import uuid4

from kinertia.cohort.record import FAILED, Record, Standing, one_line
from kinertia.cohort.resources import Finished, measured
from kinertia.errors import KinertiaError, SettingsError
from kinertia.io.provenance import VERSION
from kinertia.studies.parallel import interrupted_later

HOW = "pip install 'kinertia[cohort]'"
_NEEDED = ("dask", "distributed", "pyarrow")
PERSON_MEMORY_BYTES = 2 * 1024**3
"""Smallest memory of a fit: ten minutes of gait with plates at 1000 Hz need two thirds of it."""
RETRIES = 2
"""How often the fit of a person whose process was killed is repeated."""
KEPT_MEMORY = MappingProxyType({"MALLOC_TRIM_THRESHOLD_": 2**28, "MALLOC_MMAP_THRESHOLD_": 2**25})
"""Bytes that a worker keeps on Linux, by its environment. Dask's workers give memory back at once, and a fit asks for
it again, page by page: it took a third longer."""
SCHEDULING = MappingProxyType(
    {
        "distributed.scheduler.allowed-failures": RETRIES,
        # a killed process also loses the jobs that wait there: let them wait with the scheduler
        "distributed.scheduler.worker-saturation": 1.0,
        **{f"distributed.nanny.pre-spawn-environ.{name}": size for name, size in KEPT_MEMORY.items()},
        "logging": {"distributed": "critical"},
    }
)
"""Settings of Dask for clusters of our own."""
NO_DASHBOARD = MappingProxyType({"dashboard": False, "dashboard_address": "127.0.0.1:0"})
"""Settings of their schedulers, which listen anyway: at any free port, since another run may use the usual one."""
_SECONDS_PER_PERSON, _SECONDS_PER_FRAME = 4.0, 0.003
"""Times of one processor, for a rough guess before any measurement: see `docs/validation/long-trials.md`."""
_LEAST_LIMIT_S, _PATIENCE = 900.0, 50.0
"""A fit is given so long, and so many times the guess: what takes longer has no end."""


@dataclass(frozen=True)
class Job:
    """One person to fit.

    Attributes:
        person: name of the person.
        subject: the subject file.
        cohort: folder of the cohort's results, as workers see it.
        inputs: SHA-256 of what goes into the fit.
        trials: number of trials.
        limit_s: time after which its process is ended.
        kinertia: version of the command, which has to be the worker's.
        run: identifier of the run of the command.
    """

    person: str
    subject: Path
    cohort: Path
    inputs: str
    trials: int
    limit_s: float
    kinertia: str = VERSION
    run: str = ""

    @classmethod
    def of(cls, one: Standing, cohort: Path) -> Job:
        """Create the job of fitting a person who is due, into the folder of the cohort."""
        if one.person.subject is None:
            raise ValueError(f"{one.person.name} is not due")
        limit_s = _LEAST_LIMIT_S + _PATIENCE * guessed_seconds([one], 1)
        return cls(one.person.name, one.person.subject.resolve(), cohort, one.inputs, one.trials, limit_s)

    def record(self, status: int, sentence: str, settled: bool, seconds: float = 0.0) -> Record:
        """Return the record of how it ended; `settled` where the same input always ends so."""
        inputs = self.inputs if settled else ""
        return Record(self.person, status, one_line(sentence), inputs, self.kinertia, self.trials, round(seconds, 1))


@dataclass(frozen=True)
class ClusterSize:
    """Processes on this computer, and the memory (bytes) that each may take."""

    workers: int
    memory_bytes: int


def expect_extra() -> None:
    """Raise a KinertiaError that states what to install, unless the extra is installed."""
    missing = [name for name in _NEEDED if find_spec(name) is None]
    if missing:
        verb = "are" if missing[1:] else "is"
        raise KinertiaError(f"cohorts need {' and '.join(missing)}, which {verb} not installed; install: {HOW}")


def local_size(people: int) -> ClusterSize:
    """Return the cluster size of this computer: one process per core, fewer where memory or people do not suffice."""
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    workers = max(1, min(CPU_COUNT, MEMORY_LIMIT // PERSON_MEMORY_BYTES, people))
    return ClusterSize(workers, MEMORY_LIMIT // workers)


def guessed_seconds(due: Sequence[Standing], workers: int) -> float:
    """Estimate roughly how long fits take (s), with one processor for each process."""
    each = [_SECONDS_PER_PERSON + _SECONDS_PER_FRAME * one.frames for one in due]
    return max(sum(each) / workers, max(each, default=0.0))


@contextmanager
def local_cluster(size: ClusterSize) -> Iterator[Any]:
    """Yield a client of processes on this computer, which end with the block."""
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(SCHEDULING), ExitStack() as opened:
        with interrupted_later():
            cluster = LocalCluster(
                n_workers=size.workers,
                threads_per_worker=1,
                memory_limit=size.memory_bytes,
                processes=True,
                dashboard_address=None,
                scheduler_kwargs=dict(NO_DASHBOARD),
                silence_logs=logging.CRITICAL,
            )
            opened.enter_context(cluster)
            client = opened.enter_context(Client(cluster))
            client.register_plugin(_undisturbed())
        yield client


@contextmanager
def running_cluster(address: str) -> Iterator[Any]:
    """Yield a client of a scheduler that is already running.

    Raises:
        SettingsError: nothing answers there.
    """
    from distributed import Client

    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        reason = one_line(str(error))
        raise SettingsError(
            f"--scheduler {address}: no Dask scheduler answers there ({reason}); start it, or check the "
            "address that it shows, like tcp://node7:8786"
        ) from None
    with client:
        yield client


def doubts_of_workers(client: Any, address: str) -> list[str]:
    """Describe, a sentence each, what may keep workers of a running scheduler from fitting correctly."""
    threads = client.nthreads()
    start = f"dask worker {address} --nthreads 1"
    if not threads:
        return [f"no worker has reported to {address} yet, and the run waits until one does; start some: {start}"]
    if (most := max(threads.values())) > 1:
        return [
            f"workers of {address} have up to {most} threads, and fit as many people in one process, where nobody is "
            f"given up whose files hang; start them with one thread: {start}"
        ]
    return []


def run_jobs(client: Any, fit_person: Callable[[Job], Record], jobs: Sequence[Job]) -> Iterator[Finished]:
    """Run the jobs and yield how each ended, in the order in which they end.

    Args:
        client: client of the cluster.
        fit_person: a function of a module, which workers import by its name; what it raises is the person's failure.
        jobs: jobs, one per person.

    Raises:
        KinertiaError: the scheduler has stopped.
    """
    from distributed import as_completed

    run = uuid4().hex  # jobs of two runs on one cluster must not be taken for the same
    of_key = {f"kinertia-{run}-{k}": job for k, job in enumerate(jobs)}
    futures = [
        client.submit(measured, fit_person, replace(job, run=run), key=key, pure=False) for key, job in of_key.items()
    ]
    for future in as_completed(futures):
        job = of_key[future.key]
        if future.status == "finished":
            yield future.result()
        elif future.status == "error":
            yield Finished(job.record(FAILED, _reason(future.exception()), settled=False))
        else:
            raise KinertiaError("the Dask scheduler is gone; what is finished is kept: run the command again")
        future.release()


def _reason(error: BaseException) -> str:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        times = error.allowed_failures + 1
        return (
            f"the process that fitted it was killed {times} times, mostly for lack of memory; the next run tries "
            "again: close other programs, or use a computer with more memory"
        )
    return f"its fit could not be run on the cluster ({type(error).__name__}: {error}); the next run tries again"


def _undisturbed() -> Any:
    """Return a plugin by which Ctrl-C only reaches the waiting process, which ends the others in order."""
    from distributed import WorkerPlugin

    class Undisturbed(WorkerPlugin):  # type: ignore[misc]
        def setup(self, worker: Any) -> None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    return Undisturbed()
