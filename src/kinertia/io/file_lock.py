"""A file that one process at a time holds: the system takes the lock back when the process ends, however it ends.

So no lock is ever stale, and none has to be judged by the number of a process that another one may have by now.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from kinertia.errors import FileError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_HELD_BYTE = 1 << 20
"""Windows locks bytes, and lets nobody read them: one far behind anything that is written."""


def locked(path: Path) -> BinaryIO | None:
    """The file, made if need be and held until it is closed; None where another process holds it or none can be made.

    None also where a network drive knows no locks.
    """
    try:
        file = path.open("a+b")
    except OSError:
        return None
    try:
        if sys.platform == "win32":
            file.seek(_HELD_BYTE)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        return None
    return file


@contextmanager
def sole_use(path: Path, what: str) -> Iterator[None]:
    """Nobody else works on `what` during the block; the file at `path` says who does, and is empty afterwards.

    Raises:
        FileError: another process does, on this computer or on another with the same drive.
    """
    file = locked(path)
    if file is None:
        raise FileError(path, f"{what} is in use{_by(path)}; wait until that run has ended, or give another folder")
    with file:
        file.truncate(0)
        file.write(json.dumps({"pid": os.getpid(), "host": platform.node()}).encode())
        file.flush()
        try:
            yield
        finally:
            file.truncate(0)


def _by(path: Path) -> str:
    """Who says in the file to be at work."""
    try:
        holder = json.loads(path.read_text(encoding="utf-8"))
        return f" by process {holder['pid']} on {holder['host']}"
    except (OSError, ValueError, KeyError, TypeError):
        return " (or its drive cannot be written to, or knows no locks)"
