"""Starts workers by SLURM and dask-jobqueue: each a job with one core that fits one person at a time."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from shutil import which
from types import MappingProxyType
from typing import Any

from kinertia.cohort.cluster import HOW
from kinertia.cohort.job import RETRIES
from kinertia.cohort.slurm_jobs import replaced_jobs
from kinertia.errors import KinertiaError
from kinertia.io.slurm_file import SlurmFile

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
