"""Ends a fit that takes too long: its process is killed from outside, and a log says where it was.

A file reader may hang in compiled code that blocks every other thread of its process, Dask's and any watchdog's. The
watchdog of `faulthandler` works without them. Dask then starts another process and tries the person again, which the
log prevents.
"""

import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ENDED = "Timeout ("
"""Beginning of faulthandler's output."""


@contextmanager
def time_limit(seconds: float, log: Path, run: str) -> Iterator[None]:
    """End this process if the block takes longer; `log` then states where it was, and in which run.

    One block at a time in a process.
    """
    with log.open("w", encoding="utf-8") as file:
        file.write(_heading(run))
        file.flush()
        faulthandler.dump_traceback_later(seconds, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            file.close()  # Windows removes no file that is open
            log.unlink(missing_ok=True)


def was_ended(log: Path, run: str) -> bool:
    """Return whether a block of this run with this log was ended."""
    try:
        return log.read_text(encoding="utf-8").startswith(_heading(run) + _ENDED)
    except OSError:
        return False


def no_end(seconds: float, log: Path) -> str:
    """Describe the time limit that was exceeded."""
    return (
        f"the fit did not finish within {seconds / 60.0:.0f} min and was stopped; look for anything unusual in the "
        f"files, and send {log}, which shows where the fit was, to Kinertia's developers; the next run tries again"
    )


def _heading(run: str) -> str:
    return f"run {run}\n"
