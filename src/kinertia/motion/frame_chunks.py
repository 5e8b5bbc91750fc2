"""Frames a few at a time: what is made of each of them (axes, derivatives, rows of equations) is a hundred times larger
than its coordinates, and of a long trial is never in memory together.
"""

from __future__ import annotations

FRAMES_AT_ONCE = 2000
"""Few enough to take some tens of MB, and so many that the calls do not count."""


def pieces(count: int, most: int = FRAMES_AT_ONCE) -> list[slice]:
    """So many frames in turn, at most so many at once."""
    return [slice(start, min(start + most, count)) for start in range(0, count, most)]
