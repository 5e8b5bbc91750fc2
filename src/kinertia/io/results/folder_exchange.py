"""Exchanges two folders, at once where the system can."""

import ctypes
import os
import sys
from pathlib import Path

_HERE = -100
"""AT_FDCWD of Linux: paths count from the current folder."""
_EXCHANGE = 2
"""RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS."""


def put_in_place(new: Path, folder: Path, aside: Path) -> Path:
    """Put `new` in the place of `folder`; return where the former `folder` is now.

    Linux and macOS exchange the two in one step, so that a process killed at any moment leaves one or the other.
    Windows, and file systems that cannot, take two steps: `folder` goes to `aside`, where `sweep` finds it.

    Raises:
        OSError: it cannot be done; everything is unchanged.
    """
    if not folder.exists():
        os.rename(new, folder)
        return aside
    if _exchanged(new, folder):
        return new
    aside.parent.mkdir(exist_ok=True)
    os.rename(folder, aside)
    try:
        os.rename(new, folder)
    except OSError:
        os.rename(aside, folder)
        raise
    return aside


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange the two folders; return whether the system could."""
    if sys.platform == "win32":
        return False
    system = ctypes.CDLL(None)
    first, second = os.fsencode(one), os.fsencode(other)
    try:
        if sys.platform == "darwin":
            return bool(system.renamex_np(first, second, _EXCHANGE) == 0)
        return bool(system.renameat2(_HERE, first, _HERE, second, _EXCHANGE) == 0)
    except AttributeError:  # a C library without it
        return False
