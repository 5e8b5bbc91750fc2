"""Locks a file for one process at a time, by filelock: the system releases the lock of a dead process."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from kinertia.errors import FileError

if TYPE_CHECKING:
    from filelock import FileLock


def locked(path: Path) -> FileLock | None:
    """Lock a file, created if necessary, until the lock is released; None where another process holds it.

    None also where no file can be created, or a network drive does not support locks.
    """
    from filelock import FileLock, Timeout  # takes 40 ms to load

    lock = FileLock(path, timeout=0)
    try:
        lock.acquire()
    except (Timeout, OSError, NotImplementedError):
        return None
    return lock


@contextmanager
def sole_use(path: Path, what: str) -> Iterator[None]:
    """Ensure that no other process works on `what` during the block; a file beside the lock at `path` states which one
    does.

    Raises:
        FileError: another process does, on this computer or on another with the same drive.
    """
    holder = path.with_name(f"{path.name}.holder")
    lock = locked(path)
    if lock is None:
        raise FileError(path, f"{what} is in use{_by(holder)}; wait until that run has ended, or give another folder")
    try:
        holder.write_text(json.dumps({"pid": os.getpid(), "host": platform.node()}), encoding="utf-8")
        yield
    finally:
        holder.unlink(missing_ok=True)
        lock.release()


def _by(holder: Path) -> str:
    """Return the stated holder of the lock."""
    try:
        known = json.loads(holder.read_text(encoding="utf-8"))
        return f" by process {known['pid']} on {known['host']}"
    except (OSError, ValueError, KeyError, TypeError):
        return " (or its drive cannot be written to, or does not support locks)"
