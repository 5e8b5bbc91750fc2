"""Result folders that appear complete or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def complete_folder(folder: str | Path) -> Iterator[Path]:
    """A temporary folder beside `folder`; its files are moved into `folder` when the block ends without an error.

    Files of the same name are replaced, others in `folder` stay. After an error nothing of the block is left.
    """
    folder = Path(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        yield work
        for path in sorted(work.rglob("*")):
            target = folder / path.relative_to(work)
            if path.is_dir():
                target.mkdir(parents=True, exist_ok=True)
            else:
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(path, target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
