"""Runs work in a process of its own, with its progress, time left and outcome."""

import threading
import time
from dataclasses import dataclass

from kinertia.cohort.process import PYTHON, Process

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
