"""Makes a hidden folder for unfinished results, locked while its process lives; locks files for one process.

A killed process cannot clean up, but the system releases its lock: an unlocked folder is no longer needed.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from kinertia.errors import FileError

if TYPE_CHECKING:
    from filelock import FileLock


_PREFIX, _LOCK = ".kinertia.", "lock"
BEFORE = "before"
"""Name of the former folder while its successor takes its place in two steps."""


@contextmanager
def working_folder(within: Path) -> Iterator[Path]:
    """Yield a new hidden folder, removed at the end of the block.

    Raises:
        FileError: none can be made in `within`.
    """
    folder, lock = _new(within)
    try:
        yield folder
    finally:
        _remove(folder, lock)


def sweep(within: Path) -> None:
    """Remove what killed processes left, and restore what one of them had moved away."""
    for folder in within.glob(f"{_PREFIX}*"):
        lock = locked(folder / _LOCK) if folder.is_dir() else None
        if lock is None:
            continue
        for kept in (folder / BEFORE).glob("*"):
            if not (within / kept.name).exists():
                os.rename(kept, within / kept.name)
        _remove(folder, lock)


def _new(within: Path) -> tuple[Path, FileLock]:
    while True:
        folder = within / f"{_PREFIX}{uuid4().hex[:12]}"
        try:
            folder.mkdir()
        except OSError as error:
            problem = f"cannot be written to ({error.strerror}); give another folder for the results"
            raise FileError(within, problem) from error
        lock = locked(folder / _LOCK)
        if lock is not None and (folder / _LOCK).is_file():  # else another process swept it just now
            return folder, lock


def _remove(folder: Path, lock: FileLock) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    lock.release()
    shutil.rmtree(folder, ignore_errors=True)  # Windows removes no file that is open


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
