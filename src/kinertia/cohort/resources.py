"""Logs seconds and memory of each person's fit, to plan the next run."""

import csv
import json
import math
import os
import platform
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self, TypeVar

from kinertia.cohort.record import Record
from kinertia.io.text.csv_file import inert

LOG = "resources.csv"
_COLUMNS = ("ended", "person", "status", "seconds", "memory_mb", "worker")

Work = TypeVar("Work")


@dataclass(frozen=True)
class Finished:
    """A job that has ended.

    Attributes:
        record: how it ended.
        worker: computer and number of the process; empty where that is unknown.
        memory_mb: peak memory of the process until then; NaN where the system does not report it.
    """

    record: Record
    worker: str = ""
    memory_mb: float = math.nan

    @classmethod
    def of(cls, entries: Mapping[str, Any]) -> Self:
        """Read `text`, parsed."""
        return cls(**{**entries, "record": Record(**entries["record"])})

    @property
    def text(self) -> str:
        """All of it in one line, for another process."""
        return json.dumps(asdict(self))


def measured(fit_person: Callable[[Work], Record], job: Work) -> Finished:
    """Do a job on the worker, and return its record with the resources it took."""
    record = fit_person(job)
    return Finished(record, f"{platform.node()}:{os.getpid()}", _most_memory_mb())


def note_resources(cohort: Path, finished: Finished) -> None:
    """Add a line to the log: when a person's fit ended (UTC), how, seconds, memory and worker."""
    path, record = cohort / LOG, finished.record
    new = not path.exists()
    memory = "" if math.isnan(finished.memory_mb) else f"{finished.memory_mb:.0f}"
    ended = datetime.now(UTC).isoformat(timespec="seconds")
    row = (ended, record.person, record.status, record.seconds, memory, finished.worker)
    with path.open("a", encoding="utf-8", newline="") as stream:
        lines = csv.writer(stream, lineterminator="\n")
        if new:
            lines.writerow(_COLUMNS)
        lines.writerow([inert(cell) for cell in row])


def _most_memory_mb() -> float:
    if sys.platform == "win32":
        from psutil import Process  # Dask needs it, too

        return float(Process().memory_info().peak_wset) / 1e6
    import resource

    unit = 1.0 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
