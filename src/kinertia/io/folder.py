"""Result folders that appear complete or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kinertia.errors import FileError


def check_folder(folder: str | Path) -> None:
    """Raise FileError unless results can be written to `folder`, which need not exist yet.

    Worth calling before a long computation.
    """
    existing = _existing(Path(folder))
    if not existing.is_dir():
        raise FileError(existing, "is a file; give a folder for the results")
    if not os.access(existing, os.W_OK):
        raise FileError(existing, "cannot be written to; give another folder for the results")


def _existing(folder: Path) -> Path:
    """The folder itself, or the nearest one above it that exists."""
    return next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())


@contextmanager
def complete_folder(folder: str | Path) -> Iterator[Path]:
    """A hidden temporary folder; its files are moved into `folder` when the block ends without an error.

    Files of the same name are replaced, others in `folder` stay. After an error nothing of the block is left.

    Raises:
        FileError: the folder cannot be written to.
    """
    folder = Path(folder)
    check_folder(folder)
    work = Path(tempfile.mkdtemp(dir=_existing(folder), prefix=".kinertia."))
    try:
        yield work
        for path in sorted(work.rglob("*")):
            if path.is_file():
                target = folder / path.relative_to(work)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(path, target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
