"""The library that reads and writes C3D files, where it is missing and where it finds no file with an umlaut.

ezc3d has no wheel for Linux on ARM: Kinertia works there without it, on every file but C3D. On Windows its C++ reads
the letters of a path in the machine's code page, so that it does not find `C:/Users/Müller/walk.c3d`: such a file
goes through a copy whose path is ASCII.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from kinertia.errors import FileError

try:
    import ezc3d
except ImportError:
    ezc3d = None

ONLY_ASCII_PATHS = sys.platform == "win32"
_COPY = "copy.c3d"


def expect_ezc3d(path: Path) -> None:
    """Raise a FileError about a C3D file that says how to install ezc3d, unless it is there."""
    if ezc3d is None:
        raise FileError(
            path,
            "C3D files need the package ezc3d, which is not installed (pip has none for Linux on ARM); "
            "install it (conda install -c conda-forge ezc3d), or export TRC and MOT files",
        )


def open_c3d(path: Path, **options: Any) -> Any:
    """What is in a C3D file, as ezc3d holds it; its own errors come through.

    Raises:
        FileError: ezc3d is not installed.
    """
    expect_ezc3d(path)
    if _found_by_ezc3d(path):
        return ezc3d.c3d(str(path), **options)
    with _elsewhere(path) as original:
        shutil.copyfile(original, _COPY)
        return ezc3d.c3d(_COPY, **options)


def new_c3d(path: Path) -> Any:
    """An empty C3D file to fill, which is to be written to `path`.

    Raises:
        FileError: ezc3d is not installed.
    """
    expect_ezc3d(path)
    return ezc3d.c3d()


def save_c3d(file: Any, path: Path) -> None:
    """Write what ezc3d holds to a file."""
    if _found_by_ezc3d(path):
        file.write(str(path))
        return
    with _elsewhere(path) as target:
        file.write(_COPY)
        shutil.copyfile(_COPY, target)


def _found_by_ezc3d(path: Path) -> bool:
    return not ONLY_ASCII_PATHS or str(path).isascii()


@contextlib.contextmanager
def _elsewhere(path: Path) -> Iterator[Path]:
    """In a temporary folder, which may have a name with umlauts itself: files in it are named from within."""
    whole = path.absolute()
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        yield whole
