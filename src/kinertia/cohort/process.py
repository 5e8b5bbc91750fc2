"""Starts a process of Kinertia that works on one person at a time and answers in lines of JSON.

The page (`cli.web`) and cohorts on this computer work this way: a crash, or files that hang a reader, affect no one
else, and cancelling ends the process.
"""

import json
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

PYTHON = (sys.executable, "-P")
"""Python which imports nothing from the folder that it is started in: a file coverage.py there is somebody's data."""
_OF_ITS_OWN: dict[str, Any] = {"process_group": 0}
if sys.platform == "win32":
    _OF_ITS_OWN = {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
"""Windows opens a console for every process otherwise. Ctrl-C is for the process that waits, which ends the others."""


class Process:
    """A process that is asked by lines on its standard input, if at all, and answers on its standard output.

    >>> with Process([sys.executable, "-c", "print('{\\"share\\": 0.5}'); print('noise')"]) as process:
    ...     list(process.answers()), process.status()
    ([{'share': 0.5}], 0)
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            cwd=Path.home(),  # results replace their folder, which must be nobody's current one
            **_OF_ITS_OWN,
        )
        self.pid = self._process.pid
        self._log: list[str] = []
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        assert self._process.stderr is not None
        self._log.append(self._process.stderr.read())

    def ask(self, line: str) -> None:
        """Write a line to its standard input, unless it has ended."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def answers(self) -> Iterator[dict[str, Any]]:
        """Yield its answers until it ends; other output is left out."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                answer = json.loads(line)
            except ValueError:
                continue
            if isinstance(answer, dict):
                yield answer

    def kill(self) -> None:
        """End it at once; may be called from any thread."""
        self._process.kill()

    def status(self) -> int:
        """Wait until it has ended, and return its exit status."""
        return self._process.wait()

    @property
    def log(self) -> str:
        """Everything on its standard error, once it has ended."""
        self._listener.join()
        return "".join(self._log)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it, and free its pipes."""
        self.kill()
        self._process.wait()
        self._listener.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            with suppress(OSError):  # what it was asked and never read
                if pipe is not None:
                    pipe.close()
