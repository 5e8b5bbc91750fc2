"""Checks and fits at work: people wait in line, each is done in a process of its own, and says how far it is."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from kinertia.cli.web.library import Person, started
from kinertia.model.compiled import is_compiled

KINDS = ("check", "fit")
LOG = "failure.log"
WORKER = (sys.executable, "-m", "kinertia.cli.web.worker")
_PATIENCE_S, _PAUSE_S = 5.0, 0.1
_NO_WINDOW: int = getattr(subprocess, "CREATE_NO_WINDOW", 0)
"""Windows opens a console for every process otherwise."""


class Job:
    """A check or a fit that waits or is at work.

    Attributes:
        person: of whom.
        kind: "check" or "fit".
        stage: what it is doing; empty while it waits.
        share: of the stage that is done, 0 to 1.
    """

    def __init__(self, person: Person, kind: str) -> None:
        self.person = person
        self.kind = kind
        self.stage = ""
        self.share = 0.0
        self._since = time.monotonic()
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self.cancelled = False

    def seconds_left(self) -> float | None:
        """Of this stage, by how long its share took; None as long as nobody knows."""
        if not 0.0 < self.share < 1.0:
            return None
        return (time.monotonic() - self._since) * (1.0 - self.share) / self.share

    def cancel(self) -> None:
        """Give it up, wherever it is; may be called from any thread."""
        with self._lock:
            self.cancelled = True
            if self._process is not None:
                self._process.terminate()

    def run(self) -> dict[str, Any]:
        """Do it; how it ended, for the person's notes."""
        self._moved("starting", 0.0)
        status, error, log = self._done([*WORKER, self.kind, str(self.person.folder)])
        if self.cancelled:
            return {"how": "cancelled"}
        if status == 0:
            return {}
        if error:
            return {"how": "failed", "message": error}
        path = self.person.folder / LOG
        path.write_text(log, encoding="utf-8")
        told = log.strip().rpartition("\n")[2] or f"its process ended with status {status}"
        sentence = f"Kinertia failed, which it should not on any input ({told}); please send {path} to its developers"
        return {"how": "failed", "message": sentence}

    def _moved(self, stage: str, share: float) -> None:
        if stage != self.stage:
            self._since = time.monotonic()
        self.stage, self.share = stage, share

    def _done(self, command: Sequence[str]) -> tuple[int, str, str]:
        """Exit status, the error that it named, and what else it said."""
        with self._lock:
            if self.cancelled:
                return 1, "", ""
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                cwd=Path.home(),  # results replace their folder, which must be nobody's current one
                creationflags=_NO_WINDOW,
            )
        process = self._process
        assert process.stdout is not None
        assert process.stderr is not None
        said: list[str] = []
        listener = threading.Thread(target=lambda: said.append(process.stderr.read()))  # type: ignore[union-attr]
        listener.start()
        error = ""
        for line in process.stdout:
            told = _line(line)
            error = told.get("error", error)
            if "stage" in told:
                self._moved(told["stage"], told["share"])
        status = process.wait()
        listener.join()
        return status, error, "".join(said)


class Jobs:
    """Two lines of people: one for checks, which take seconds, and one for fits.

    Attributes:
        compiling: whether fits wait for what is compiled once on a machine.
    """

    def __init__(self, warm_up: Sequence[str] = ()) -> None:
        """Nobody waits yet; `warm_up` is the command that compiles, where that is to be done before the first fit."""
        self._warm_up = warm_up
        self.compiling = False
        self._lines: dict[str, list[Job]] = {kind: [] for kind in KINDS}
        self._changed = threading.Condition()
        self._closed = False

    def add(self, person: Person, kind: str) -> None:
        """Let a person wait for a check or a fit, unless they do already."""
        with self._changed:
            if self.of(person, kind) is None:
                person.note(**{kind: started()})
                self._lines[kind].append(Job(person, kind))
                self._changed.notify_all()

    def of(self, person: Person, kind: str) -> Job | None:
        """The person's check or fit that waits or is at work."""
        return next((job for job in self._lines[kind] if job.person == person), None)

    def busy(self, person: Person) -> bool:
        """Whether anything of the person waits or is at work."""
        return any(self.of(person, kind) is not None for kind in KINDS)

    def place(self, job: Job) -> int:
        """How many are before it."""
        line = self._lines[job.kind]
        return line.index(job) if job in line else 0

    def cancel(self, person: Person, kind: str) -> None:
        """Give up a person's check or fit, and wait until it has ended."""
        job = self.of(person, kind)
        if job is None:
            return
        job.cancel()
        with self._changed:
            if job.stage == "" and job in self._lines[kind]:  # whoever waits just leaves
                self._lines[kind].remove(job)
                person.note(**{kind: {"how": "cancelled"}})
            self._changed.wait_for(lambda: job not in self._lines[kind], _PATIENCE_S)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Works through the lines during the block; what is not finished at its end is given up, and noted so."""
        threads = [threading.Thread(target=self._work, args=(kind,), daemon=True) for kind in KINDS]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            with self._changed:
                self._closed = True
                unfinished = [job for line in self._lines.values() for job in line]
                self._changed.notify_all()
            for job in unfinished:
                job.cancel()
            for thread in threads:
                thread.join(_PATIENCE_S)
            for job in unfinished:
                if job.person.folder.is_dir() and job.person.notes().get(job.kind, {}).get("how") in (
                    "started",
                    "cancelled",
                ):
                    job.person.note(**{job.kind: {"how": "interrupted"}})

    def _compile(self) -> None:
        """Compile what has not been compiled on this machine, while people still look for their files."""
        if not self._warm_up or is_compiled():
            return
        self.compiling = True
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(self._warm_up, stdin=quiet, stdout=quiet, stderr=quiet, creationflags=_NO_WINDOW)
        while process.poll() is None and not self._closed:
            time.sleep(_PAUSE_S)
        if process.poll() is None:
            process.terminate()
        self.compiling = False

    def _work(self, kind: str) -> None:
        if kind == "fit":
            self._compile()
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
                line.remove(job)
                if job.person.folder.is_dir():
                    job.person.note(**{kind: ended})
                self._changed.notify_all()


def _line(text: str) -> dict[str, Any]:
    """What a line of a worker says; nothing where it is not one of ours."""
    try:
        told = json.loads(text)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}
