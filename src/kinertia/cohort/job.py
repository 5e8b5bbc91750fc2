"""Defines a job of a cohort, one person to fit, and guesses its time and memory from earlier ones."""

import csv
import json
import math
import os
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self, TypeVar
from uuid import uuid4

from kinertia.cohort.record import FAILED, Record, Standing, one_line
from kinertia.io.text.csv_file import inert
from kinertia.io.versions import VERSION

RETRIES = 2
"""How often the fit of a person whose process was killed is repeated."""
_SECONDS_PER_PERSON, _SECONDS_PER_FRAME = 4.0, 0.003
"""Times of one processor, for a rough guess before any measurement: see `docs/validation/long-trials.md`."""
_LEAST_LIMIT_S, _PATIENCE = 900.0, 50.0
"""A fit is given so long, and so many times the guess: what takes longer has no end."""
LOG = "resources.csv"
_COLUMNS = ("ended", "person", "status", "seconds", "memory_mb", "worker")
Work = TypeVar("Work")


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
        session: which of the person's sessions it is; empty where there is one only.
        kinertia: version of the command, which has to be the worker's.
        run: identifier of the job, of which each run of the command has another.
    """

    person: str
    subject: Path
    cohort: Path
    inputs: str
    trials: int
    limit_s: float
    session: str = ""
    kinertia: str = VERSION
    run: str = field(default_factory=lambda: uuid4().hex)

    @classmethod
    def of(cls, standing: Standing, cohort: Path) -> Self:
        """Create the job of fitting a person who is due, into the folder of the cohort."""
        if standing.person.subject is None:
            raise ValueError(f"{standing.person.name} is not due")
        limit_s = _LEAST_LIMIT_S + _PATIENCE * guessed_seconds([standing], 1)
        person = standing.person
        return cls(
            person.name,
            standing.person.subject.resolve(),
            cohort,
            standing.inputs,
            standing.trials,
            limit_s,
            person.session,
        )

    @classmethod
    def of_text(cls, text: str) -> Self:
        """Read `text`."""
        entries = json.loads(text)
        paths = {name: Path(entries[name]) for name in ("subject", "cohort")}
        return cls(**{**entries, **paths})

    @property
    def text(self) -> str:
        """The job in one line, for another process."""
        return json.dumps(asdict(self), default=str)

    def killed(self, times: int = RETRIES + 1) -> Record:
        """Return the record of a person whose process was killed each time."""
        sentence = (
            f"the process that fitted it was killed {times} times, probably for lack of memory; the next run tries "
            "again: close other programs, or use a computer with more memory"
        )
        return self.record(FAILED, sentence, settled=False)

    def record(self, status: int, sentence: str, settled: bool, seconds: float = 0.0) -> Record:
        """Return the record of how it ended; `settled` where the same input always ends so."""
        inputs = self.inputs if settled else ""
        return Record(self.person, status, one_line(sentence), inputs, self.kinertia, self.trials, round(seconds, 1))


def guessed_seconds(due: Sequence[Standing], workers: int) -> float:
    """Estimate roughly how long fits take (s), with one processor for each process."""
    each_s = [_SECONDS_PER_PERSON + _SECONDS_PER_FRAME * standing.frames for standing in due]
    return max(sum(each_s) / workers, max(each_s, default=0.0))


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
