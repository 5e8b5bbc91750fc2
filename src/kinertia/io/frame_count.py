"""Reads the number of frames from a trial's header, to estimate time."""

from __future__ import annotations

from pathlib import Path

from kinertia.errors import FileError
from kinertia.io import c3d_structure, trc


def frame_count(path: Path) -> int:
    """Frames that the header of a .c3d or .trc file announces; 0 where it does not say: reading it will tell why."""
    try:
        return c3d_structure.header_frames(path) if path.suffix.lower() == ".c3d" else trc.header_frames(path)
    except (FileError, OSError):
        return 0
