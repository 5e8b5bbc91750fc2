"""Result folders that appear complete or not at all, and never among somebody else's files unasked."""

from __future__ import annotations

import json
import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kinertia.errors import FileError

GENERATOR = '<meta name="generator" content="kinertia'
"""In the head of every HTML page that is a result of its own."""
_TELLING = (".json", ".html")
"""Types of the result files that name Kinertia as what made them."""


def check_folder(folder: str | Path) -> None:
    """Raise FileError unless results can be written to `folder`, which need not exist yet.

    Worth calling before a long computation.
    """
    existing = _existing(Path(folder))
    if not existing.is_dir():
        raise FileError(existing, "is a file; give a folder for the results")
    if not os.access(existing, os.W_OK):
        raise FileError(existing, "cannot be written to; give another folder for the results")


def expect_own_folder(folder: str | Path) -> None:
    """Raise FileError where `folder` holds files and none of them says that Kinertia wrote the results there.

    Hidden files do not count.
    """
    folder = Path(folder)
    if not folder.is_dir():
        return
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    if names and not any(_says_kinertia(folder / name) for name in names if name.endswith(_TELLING)):
        listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        raise FileError(
            folder,
            f"holds files that are not results of Kinertia ({listed}); give another folder, or --force to write among "
            f"them",
        )


def _says_kinertia(path: Path) -> bool:
    """Whether a file is there and names Kinertia as what made it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    if path.suffix == ".html":
        return GENERATOR in text[:2000]
    try:
        told = json.loads(text)
    except ValueError:
        return False
    return isinstance(told, dict) and "kinertia" in told


def _existing(folder: Path) -> Path:
    """The folder itself, or the nearest one above it that exists."""
    return next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())


@contextmanager
def complete_folder(folder: str | Path) -> Iterator[Path]:
    """A hidden temporary folder; its files are moved into `folder` when the block ends without an error.

    Files of the same name are replaced, others in `folder` stay. After an error or Ctrl-C nothing of the block is left;
    Ctrl-C during the moving takes effect after it.

    Raises:
        FileError: the folder cannot be written to.
    """
    folder = Path(folder)
    check_folder(folder)
    work = Path(tempfile.mkdtemp(dir=_existing(folder), prefix=".kinertia."))
    try:
        yield work
        with _uninterrupted():
            for path in sorted(work.rglob("*")):
                if path.is_file():
                    target = folder / path.relative_to(work)
                    target.parent.mkdir(parents=True, exist_ok=True)
                    os.replace(path, target)
    finally:
        shutil.rmtree(work, ignore_errors=True)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Holds Ctrl-C back until the block is done; only the main thread can, and only it is interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt


def write_then_rename(path: Path, text: str) -> None:
    """Write text so that `path` appears complete or not at all."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
