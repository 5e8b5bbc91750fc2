"""Queues checks, fits and comparisons of conditions, runs each in a process of its own, and reports its progress."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from kinertia.cli.web.library import LOG, PersonFolder, started
from kinertia.cohort.local import Process
from kinertia.errors import internal_error
from kinertia.io.file_names import PYTHON
from kinertia.model.compiled import is_compiled

KINDS = ("check", "fit", "comparison")
_PATIENCE_S = 5.0
_ENDED_FROM_OUTSIDE = (-9, -15)
"""SIGKILL and SIGTERM, as Python reports them."""
_OUTSIDE = "The operating system ended it, most likely because memory ran out: close other programs and start it again."
WORKER = (*PYTHON, "-m", "kinertia.cli.web.worker")


@dataclass(frozen=True)
class End:
    """How a process ended.

    Attributes:
        status: exit status; 1 where it was cancelled before it began.
        error: error of a file or an entry that it reported; empty if none.
        log: its other output.
    """

    status: int
    error: str
    log: str


class Work:
    """Work of a separate process, which reports its stage and the share done line by line.

    Attributes:
        stage: current stage; empty while it waits.
        share: share of the stage that is done, 0 to 1.
        cancelled: whether it was cancelled.
    """

    def __init__(self) -> None:
        self.stage = ""
        self.share = 0.0
        self.cancelled = False
        self._since = self._reported = time.monotonic()
        self._process: Process | None = None
        self._lock = threading.Lock()

    def seconds_left(self) -> float | None:
        """Estimate the time left of this stage from how long its share took; None as long as it is unknown."""
        if not 0.0 < self.share < 1.0:
            return None
        left_on_request = (self._reported - self._since) * (1.0 - self.share) / self.share
        return max(left_on_request - (time.monotonic() - self._reported), 1.0)

    def cancel(self) -> None:
        """Cancel the work, whatever its stage; may be called from any thread."""
        with self._lock:
            self.cancelled = True
            if self._process is not None:
                self._process.kill()

    def done(self, *arguments: str) -> End:
        """Run the work with these arguments of the worker; return how it ended."""
        self._moved("starting", 0.0)
        with self._lock:
            if self.cancelled:
                return End(1, "", "")
            self._process = Process([*WORKER, *arguments])
        error = ""
        with self._process as process:
            for message in process.answers():
                error = message.get("error", error)
                if "stage" in message:
                    self._moved(message["stage"], message["share"])
            return End(process.status(), error, process.log)

    def _moved(self, stage: str, share: float) -> None:
        self._reported = time.monotonic()
        if stage != self.stage:
            self._since = self._reported
        self.stage, self.share = stage, share


class Job(Work):
    """A check, a fit or a comparison that waits or is running.

    Attributes:
        person: the person.
        kind: "check", "fit" or "comparison".
        arguments: further arguments of the worker: the conditions of a comparison.
    """

    def __init__(self, person: PersonFolder, kind: str, arguments: Sequence[str] = ()) -> None:
        super().__init__()
        self.person = person
        self.kind = kind
        self.arguments = tuple(arguments)

    def run(self) -> dict[str, Any]:
        """Run the job; return how it ended, for the person's notes."""
        ended = self.done(self.kind, str(self.person.folder), *self.arguments)
        if self.cancelled:
            return {"how": "cancelled"}
        path = self.person.folder / LOG
        path.unlink(missing_ok=True)
        if ended.status == 0:
            return {}
        if ended.error:
            return {"how": "failed", "message": ended.error}
        if ended.status in _ENDED_FROM_OUTSIDE:
            return {"how": "failed", "message": _OUTSIDE}
        path.write_text(ended.log, encoding="utf-8")
        reason = ended.log.strip().rpartition("\n")[2] or f"its process ended with status {ended.status}"
        return {"how": "failed", "message": internal_error(reason, path)}


class Jobs:
    """Queues of people: one for checks, which take seconds, one for fits, and one for comparisons.

    Attributes:
        preparing: one-time compilation on a machine, until it is done; fits wait for it.
    """

    def __init__(self, prepare: bool = False) -> None:
        """Create empty queues; `prepare` compiles beforehand, where not yet done, what the first fit needs."""
        self.preparing = Work() if prepare and not is_compiled() else None
        self._lines: dict[str, list[Job]] = {kind: [] for kind in KINDS}
        self._changed = threading.Condition()
        self._closed = False

    def add(self, person: PersonFolder, kind: str, *arguments: str) -> None:
        """Queue a check, a fit or a comparison of a person, unless one is queued already."""
        with self._changed:
            if self.of(person, kind) is None:
                person.note(**{kind: started()})
                self._lines[kind].append(Job(person, kind, arguments))
                self._changed.notify_all()

    def of(self, person: PersonFolder, kind: str) -> Job | None:
        """Return the person's check or fit that waits or is running."""
        return next((job for job in self._lines[kind] if job.person == person), None)

    def busy(self, person: PersonFolder) -> bool:
        """Return whether any job of the person waits or is running."""
        return any(self.of(person, kind) is not None for kind in KINDS)

    def place(self, job: Job) -> int:
        """Return the number of jobs before it."""
        line = self._lines[job.kind]
        return line.index(job) if job in line else 0

    def cancel(self, person: PersonFolder, kind: str) -> None:
        """Cancel a person's check or fit, and wait until it has ended."""
        job = self.of(person, kind)
        if job is None:
            return
        job.cancel()
        with self._changed:
            if job.stage == "" and job in self._lines[kind]:  # whoever waits just leaves
                person.note(**{kind: {"how": "cancelled"}})
                self._lines[kind].remove(job)
            self._changed.wait_for(lambda: job not in self._lines[kind], _PATIENCE_S)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Work through the queues during the block; unfinished jobs are then cancelled and noted as interrupted."""
        threads = [threading.Thread(target=self._work, args=(kind,), daemon=True) for kind in KINDS]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            with self._changed:
                self._closed = True
                unfinished = [job for line in self._lines.values() for job in line]
                preparing = self.preparing
                self._changed.notify_all()
            for work in [*unfinished, *([preparing] if preparing else [])]:
                work.cancel()
            for thread in threads:
                thread.join(_PATIENCE_S)
            for job in unfinished:
                if job.person.folder.is_dir() and job.person.notes().get(job.kind, {}).get("how") in (
                    "started",
                    "cancelled",
                ):
                    job.person.note(**{job.kind: {"how": "interrupted"}})

    def _work(self, kind: str) -> None:
        if kind == "fit" and self.preparing is not None:
            with suppress(OSError):  # then the first fit compiles it
                self.preparing.done("prepare")
            self.preparing = None
        line = self._lines[kind]
        while True:
            with self._changed:
                self._changed.wait_for(lambda: line or self._closed)
                if self._closed:
                    return
                job = line[0]
                job.stage = "starting"
            try:
                ended = job.run()
            except OSError as error:
                ended = {"how": "failed", "message": f"{error.filename or kind}: {error.strerror or error}"}
            with self._changed:
                # noted first: a page shows how it ended as soon as it is no longer in the queue
                if job.person.folder.is_dir():
                    job.person.note(**{kind: ended})
                line.remove(job)
                self._changed.notify_all()
