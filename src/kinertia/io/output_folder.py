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
from uuid import uuid4

from kinertia.errors import FileError

GENERATOR = '<meta name="generator" content="kinertia'
"""In the head of every HTML page that is a result of its own."""
_TELLING = (".json", ".html")
"""Types of the result files that name Kinertia as what made them."""
_NEW, _BEFORE = "new", "before"
"""Parts of the temporary folder: results to be, and the files that they replace."""


def check_folder(folder: str | Path) -> None:
    """Raise FileError unless results can be written to `folder`, which need not exist yet.

    Worth calling before a long computation.
    """
    existing = _existing(Path(folder))
    if not existing.is_dir():
        raise FileError(existing, "is a file; give a folder for the results")
    _hidden_folder(existing).rmdir()  # Windows does not tell otherwise whether that is allowed


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
    places = (folder.absolute(), *folder.absolute().parents)
    existing = next((path for path in places if path.exists()), None)
    if existing is None:
        raise FileError(folder, "on a drive or share that is not there; give another folder for the results")
    return existing


def _hidden_folder(within: Path) -> Path:
    """A new folder of a name of its own."""
    folder = within / f".kinertia.{uuid4().hex[:12]}"
    try:
        folder.mkdir()
    except OSError as error:
        problem = f"cannot be written to ({error.strerror}); give another folder for the results"
        raise FileError(within, problem) from error
    return folder


@contextmanager
def complete_folder(folder: str | Path) -> Iterator[Path]:
    """A hidden temporary folder; its files are moved into `folder` when the block ends without an error.

    Files of the same name are replaced, others in `folder` stay. After an error or Ctrl-C nothing of the block is left,
    and what was there before is as it was; Ctrl-C during the moving takes effect after it.

    Raises:
        FileError: the folder cannot be written to, or a file in it not be replaced.
    """
    folder = Path(folder)
    check_folder(folder)
    work = _hidden_folder(_existing(folder))
    try:
        (work / _NEW).mkdir()
        yield work / _NEW
        with _uninterrupted():
            _move_all(work, folder)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _move_all(work: Path, folder: Path) -> None:
    """Move every new file to its place in `folder`, and what it replaces out of the way: all of them or none.

    Windows lets nobody replace a file that another program has open.
    """
    done: list[tuple[Path, Path]] = []

    def move(source: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
        done.append((source, target))

    for path in sorted(path for path in (work / _NEW).rglob("*") if path.is_file()):
        name = path.relative_to(work / _NEW)
        try:
            if (folder / name).is_file():
                move(folder / name, work / _BEFORE / name)
            move(path, folder / name)
        except OSError as error:
            for source, target in reversed(done):
                os.replace(target, source)
            problem = (
                f"cannot be replaced ({error.strerror}): nothing was written; close the program that has it open, and "
                "run the command again"
            )
            raise FileError(folder / name, problem) from error


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
