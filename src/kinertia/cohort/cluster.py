"""Fits a cohort on a Dask cluster that is running, or that SLURM starts, one worker per core.

Dask decides what runs where, and repeats the work of a process that was killed. One process works on one person at a
time, with one thread of the linear algebra library, as Dask sets it for its workers.

dask-jobqueue replaces a worker that has reported and is then lost. If a job ends before it reports (no such Python on
the node, no connection to this computer, a node that fails), dask-jobqueue keeps waiting; SLURM's queue shows such
jobs.
"""

import logging
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from getpass import getuser
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from threading import Event, Thread
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field, ValidationError

from kinertia.cohort.job import RETRIES, Finished, Job, measured
from kinertia.cohort.record import FAILED, Record, one_line
from kinertia.errors import FileError, KinertiaError, SettingsError, how_to_install
from kinertia.io.text.toml_lines import read_toml
from kinertia.settings import Table

HOW = how_to_install("cohort")
_NEEDED = ("dask", "distributed", "pyarrow")
LOOK_S = 30.0
"""Interval between two looks at the queue, made only while a worker is missing."""
IN_VAIN = 3
"""Number of times that all jobs are submitted if none of them reports."""
_ANSWER_S = 60.0
"""Time limit (s) for squeue to answer."""
Lines = Annotated[tuple[str, ...], Field(strict=False)]
ENVIRONMENT = MappingProxyType({"MALLOC_TRIM_THRESHOLD_": 2**28, "MALLOC_MMAP_THRESHOLD_": 2**25, "PYTHONSAFEPATH": 1})
"""Environment of a worker: bytes that it keeps on Linux, and that it imports nothing from the folder it is started in.
Dask's workers give memory back at once, and a fit asks for it again, page by page: it took a third longer."""
_SCHEDULING = MappingProxyType(
    {
        "distributed.scheduler.allowed-failures": RETRIES,
        # a killed process also loses the jobs that wait there: let them wait with the scheduler
        "distributed.scheduler.worker-saturation": 1.0,
        "logging": {"distributed": "critical"},
    }
)
_NO_DASHBOARD = MappingProxyType({"dashboard": False, "dashboard_address": "127.0.0.1:0"})
"""The scheduler listens anyway: at any free port, since another run may use the usual one."""
_NO_LOGS = ("--output=/dev/null", "--error=/dev/null")
"""Otherwise SLURM leaves a file per job where the command was started."""


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


class SlurmFile(Table):
    """Content of a whole SLURM file; every entry may be left out.

    Examples:
        >>> from kinertia.cohort.cluster import SlurmFile
        >>> SlurmFile(partition="short").workers
        10
    """

    workers: int = Field(default=10, ge=1, le=10_000, description="jobs to ask for; each fits one person at a time")
    memory_gb: float = Field(default=4.0, ge=1.0, description="of each job")
    time: str = Field(default="04:00:00", description="time limit of a job, hours:minutes:seconds")
    partition: str | None = Field(default=None, description="left out: the cluster's default")
    account: str | None = Field(default=None, description="who pays")
    directives: Lines = Field(default=(), description='further lines for sbatch, like ["--qos=low"]')
    before: Lines = Field(default=(), description='commands before the worker starts, like ["module load python"]')
    python: str | None = Field(default=None, description="on the nodes; left out: the one that runs this command")
    interface: str | None = Field(default=None, description="network that nodes and this computer share, like ib0")
    logs: str | None = Field(default=None, description="folder for SLURM's logs; left out: none are kept")


def read_slurm(path: Path) -> SlurmFile:
    """Read and check the file.

    Raises:
        FileError: no such file, an unknown key, or an impossible value; with the line.
    """
    document = read_toml(path, "a file that says how to ask SLURM for workers")
    try:
        return SlurmFile.model_validate(document.content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        known = ", ".join(SlurmFile.model_fields)
        problem = f"{place}: {first['msg']}"
        if first["type"] == "extra_forbidden":
            problem = f"unknown entry '{place}'; known are {known}"
        raise FileError(path, problem, document.line(first["loc"]) or document.last_line) from None


@contextmanager
def replaced_jobs(cluster: Any, client: Any, wanted: SlurmFile, jobs: int) -> Iterator[None]:
    """Submit the jobs, and resubmit each that ends, until the block does.

    Args:
        cluster: dask-jobqueue's, without jobs.
        client: client of the cluster; it is closed when the jobs are given up.
        wanted: requested resources.
        jobs: number of jobs.

    Raises:
        KinertiaError: SLURM accepts none, or none reports.
    """
    lookout = _Lookout(cluster, client, wanted, jobs)
    thread = Thread(target=lookout.run, daemon=True)
    try:
        refused = cluster.sync(_asked, cluster, jobs)
        if refused and all(job.job_id is None for job in cluster.workers.values()):
            raise KinertiaError(f"--slurm: sbatch refused the job: {one_line(refused)}; correct the file of --slurm")
        cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)  # another job for each that is no longer there
        thread.start()
        yield
    except KinertiaError:
        if lookout.problem:
            raise KinertiaError(lookout.problem) from None
        raise
    finally:
        lookout.over.set()
        if thread.is_alive():
            thread.join()
        for name in [name for name, job in cluster.workers.items() if job.job_id is None]:
            cluster.sync(_forget, cluster, name)  # which its end would wait for


async def _asked(cluster: Any, jobs: int) -> str:
    """Submit the jobs; return sbatch's message on the first that it refused, or nothing."""
    while len(cluster.worker_spec) < jobs:  # as `scale` does, which leaves what sbatch says to a log
        cluster.worker_spec.update(cluster.new_worker_spec())
    try:
        await cluster
    except RuntimeError as error:
        return str(error).partition("stderr:\n")[2] or str(error)
    return ""


class _Lookout:
    """Watcher of the queue for jobs whose workers are missing.

    Attributes:
        over: set when watching is no longer needed.
        problem: why the jobs were given up; empty unless they were.
    """

    def __init__(self, cluster: Any, client: Any, wanted: SlurmFile, jobs: int) -> None:
        self.over = Event()
        self.problem = ""
        self._cluster, self._client, self._wanted, self._jobs = cluster, client, wanted, jobs
        self._gone: dict[str, str | None] = {}
        self._in_vain: list[str | None] = []

    def run(self) -> None:
        """Watch until it is over."""
        while not self.problem and not self.over.wait(LOOK_S):
            self._look()

    def _look(self) -> None:
        observed = set(self._cluster.observed)
        if observed:
            self._in_vain.clear()
        missing = {name: job for name, job in dict(self._cluster.workers).items() if name not in observed}
        queue = _queue() if missing else set()
        if queue is None:
            return
        gone = {name: job.job_id for name, job in missing.items() if job.job_id not in queue}
        # at the second look: by then Dask itself has replaced a worker that had reported
        for name in [name for name, job_id in gone.items() if self._gone.get(name, "") == job_id]:
            self._in_vain.append(gone.pop(name))
            self._cluster.sync(_forget, self._cluster, name)
        self._gone = gone
        if len(self._in_vain) >= IN_VAIN * self._jobs:
            self.problem = self._sentence()
            self._client.close()

    def _sentence(self) -> str:
        ended = [job_id for job_id in self._in_vain if job_id is not None]
        refused = len(self._in_vain) - len(ended)
        said = f"{len(ended)} SLURM jobs ended before their workers reported to {self._cluster.scheduler_address}"
        also = f" ({refused} more were refused by sbatch)" if refused else ""
        causes = (
            "the nodes have no such Python or no Kinertia (python, before), do not reach this computer (interface), or "
            "memory_gb or time do not suffice"
        )
        if self._wanted.logs is None:
            evidence = 'set logs = "slurm-logs" to keep their output'
        else:
            evidence = f"the last one's log says: {_last_line(Path(self._wanted.logs), ended)}"
        return f"--slurm: {said}{also}, and none did; likely {causes}; {evidence}"


async def _forget(cluster: Any, name: str) -> None:
    """Drop a job that has ended, so that the cluster submits another one in its place."""
    from distributed import Status

    job = cluster.workers.pop(name)
    await job.close()
    job.status = Status.closed


def _queue() -> set[str] | None:
    """Return this user's jobs that wait or run; None where SLURM does not answer."""
    command = ["squeue", "--noheader", f"--user={getuser()}", "--format=%A"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=_ANSWER_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return set(answer.stdout.split())


def _last_line(logs: Path, job_ids: list[str]) -> str:
    """Return the last line that the last of these jobs wrote as an error."""
    texts = [path.read_text(errors="replace") for job in job_ids[-1:] for path in logs.glob(f"*-{job}*.err")]
    lines = [line.strip() for text in texts for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else f"nothing (look into {logs})"


@contextmanager
def slurm_cluster(wanted: SlurmFile, people: int) -> Iterator[Any]:
    """Yield a client of workers that SLURM starts when it has room; its jobs end with the block.

    Args:
        wanted: requested resources.
        people: number of people to be fitted, the largest number of workers.

    Raises:
        KinertiaError: dask-jobqueue or SLURM is not installed, SLURM accepts no job, or none of them reports.
    """
    if find_spec("dask_jobqueue") is None:
        raise KinertiaError(f"--slurm needs dask-jobqueue, which is not installed: {HOW}")
    if which("sbatch") is None:
        raise KinertiaError("--slurm: there is no sbatch here; run the command on a login node of the cluster")
    import dask
    from dask_jobqueue import SLURMCluster
    from distributed import Client

    with (
        dask.config.set(_SCHEDULING),
        SLURMCluster(
            cores=1,
            processes=1,
            memory=f"{wanted.memory_gb:g}GB",
            walltime=wanted.time,
            queue=wanted.partition,
            account=wanted.account,
            job_extra_directives=[*wanted.directives, *([] if wanted.logs else _NO_LOGS)],
            job_script_prologue=[*(f"export {name}={value}" for name, value in ENVIRONMENT.items()), *wanted.before],
            interface=wanted.interface,
            log_directory=wanted.logs,
            scheduler_options=dict(_NO_DASHBOARD),
            silence_logs=logging.CRITICAL,
            **({} if wanted.python is None else {"python": wanted.python}),
        ) as cluster,
        Client(cluster) as client,
        replaced_jobs(cluster, client, wanted, min(wanted.workers, people)),
    ):
        yield client
