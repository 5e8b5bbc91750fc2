"""Replaces SLURM jobs that end before their workers report, and gives up where none ever does.

dask-jobqueue replaces a worker that has reported and is then lost. If a job ends before it reports (no such Python on
the node, no connection to this computer, a node that fails), dask-jobqueue keeps waiting; SLURM's queue shows such
jobs.
"""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from getpass import getuser
from pathlib import Path
from threading import Event, Thread
from typing import Any

from kinertia.cohort.record import one_line
from kinertia.errors import KinertiaError
from kinertia.io.slurm_file import SlurmFile

LOOK_S = 30.0
"""Interval between two looks at the queue, made only while a worker is missing."""
IN_VAIN = 3
"""Number of times that all jobs are submitted if none of them reports."""
_ANSWER_S = 60.0
"""Time limit (s) for squeue to answer."""


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
