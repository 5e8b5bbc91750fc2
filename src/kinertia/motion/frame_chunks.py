"""Splits frames into chunks, to limit memory in long trials.

The intermediate results of a frame (axes, derivatives, rows of equations) are a hundred times larger than its
coordinates, and in a long trial never fit into memory together.
"""

FRAMES_AT_ONCE = 2000
"""Few enough to take some tens of MB, and enough that the calls take no noticeable time."""


def pieces(count: int, most: int = FRAMES_AT_ONCE) -> list[slice]:
    """Split `count` frames into slices of at most `most`."""
    return [slice(start, min(start + most, count)) for start in range(0, count, most)]
