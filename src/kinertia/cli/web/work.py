"""Runs work in a process of its own, with its progress, time left and outcome."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

WORKER = (sys.executable, "-m", "kinertia.cli.web.worker")
_NO_WINDOW: int = getattr(subprocess, "CREATE_NO_WINDOW", 0)
"""Windows opens a console for every process otherwise."""


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
        self._process: subprocess.Popen[str] | None = None
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
                self._process.terminate()

    def done(self, *arguments: str) -> End:
        """Run the work with these arguments of the worker; return how it ended."""
        self._moved("starting", 0.0)
        with self._lock:
            if self.cancelled:
                return End(1, "", "")
            process = self._process = _started([*WORKER, *arguments])
        assert process.stdout is not None
        assert process.stderr is not None
        said: list[str] = []
        listener = threading.Thread(target=lambda: said.append(process.stderr.read()))  # type: ignore[union-attr]
        listener.start()
        error = ""
        for line in process.stdout:
            message = _line(line)
            error = message.get("error", error)
            if "stage" in message:
                self._moved(message["stage"], message["share"])
        status = process.wait()
        listener.join()
        return End(status, error, "".join(said))

    def _moved(self, stage: str, share: float) -> None:
        self._reported = time.monotonic()
        if stage != self.stage:
            self._since = self._reported
        self.stage, self.share = stage, share


def _started(command: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        cwd=Path.home(),  # results replace their folder, which must be nobody's current one
        creationflags=_NO_WINDOW,
    )


def _line(text: str) -> dict[str, Any]:
    """Parse a line of a worker; empty where it is not one of ours."""
    try:
        message = json.loads(text)
    except ValueError:
        return {}
    return message if isinstance(message, dict) else {}
