"""Fits a cohort on a running Dask cluster, or on one that SLURM starts (`slurm`).

Dask decides what runs where, and repeats the work of a process that was killed. One process works on one person at a
time, with one thread of the linear algebra library, as Dask sets it for its workers.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from kinertia.cohort.job import Finished, Job, measured
from kinertia.cohort.record import FAILED, Record, one_line
from kinertia.errors import KinertiaError, SettingsError, how_to_install

HOW = how_to_install("cohort")
_NEEDED = ("dask", "distributed", "pyarrow")


def expect_extra() -> None:
    """Raise a KinertiaError that states what to install, unless the extra is installed."""
    missing = [name for name in _NEEDED if find_spec(name) is None]
    if missing:
        verb = "are" if missing[1:] else "is"
        raise KinertiaError(f"cohorts need {' and '.join(missing)}, which {verb} not installed: {HOW}")


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
            f"workers at {address} have up to {most} threads and fit that many people in one process, where a fit that "
            f"hangs cannot be stopped; start them with one thread: {start}"
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

    of_key = {f"kinertia-{job.run}": job for job in jobs}  # never taken for those of another run on the cluster
    futures = [client.submit(measured, fit_person, job, key=key, pure=False) for key, job in of_key.items()]
    for future in as_completed(futures):
        job = of_key[future.key]
        if future.status == "finished":
            yield future.result()
        elif future.status == "error":
            yield Finished(_failed(job, future.exception()))
        else:
            raise KinertiaError("lost the Dask scheduler; finished results are kept: run the command again")
        future.release()


def _failed(job: Job, error: BaseException) -> Record:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return job.killed(error.allowed_failures + 1)
    sentence = f"its fit could not be run on the cluster ({type(error).__name__}: {error}); the next run tries again"
    return job.record(FAILED, sentence, settled=False)
