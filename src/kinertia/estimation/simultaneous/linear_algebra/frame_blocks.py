"""Splits a trial into time blocks, for two threads and to limit memory; stores arrays of long trials on disk.

Splines are coupled only to their neighbours. Those of one time block can be eliminated as soon as all frames that touch
them are summed, and later blocks need only one block of splines from them (`elimination`). The frames of a time block
touch its own splines and the first block of splines of the next, which gets its other terms from its own frames.
"""

import mmap
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import IO, Self

import numpy as np

from kinertia.errors import KinertiaError
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import SPLINES_PER_BLOCK, NormalEquations
from kinertia.estimation.simultaneous.markers.marker_errors import LATER

TOGETHER_BYTES = 2**27
"""Trials whose normal equations together are no larger, a minute of gait, are two time blocks each. Beyond that, memory
matters more than time. Their processing temporarily takes some four times as much."""
_SHARE = 16
"""Inverse of the share of it that a time block of longer trials takes."""
_FRAMES_OF_GRADIENT = 2000
"""Approximate number of frames of a time block for gradients, which need less memory: fewer would take longer."""
_SLICES = ("splines", "touched", "frames")
_ALIGNED = mmap.ALLOCATIONGRANULARITY
"""Groups begin at multiples of it in the file (bytes), as mapping them requires."""


@dataclass(frozen=True)
class TimeBlock:
    """A time block: neighbouring splines of a trial, and the frames whose first active spline is one of them.

    Attributes:
        splines: its own.
        touched: splines that its frames touch: its own and, except in the trial's last time block, a block of the next.
        frames: indices.
    """

    splines: slice
    touched: slice
    frames: slice

    @classmethod
    def whole(cls, basis: MotionBasis) -> Self:
        """Return the whole trial as one time block."""
        return cls(slice(0, basis.size), slice(0, basis.size), slice(0, len(basis.first)))

    @property
    def size(self) -> int:
        """Number of splines that its frames touch."""
        result: int = self.touched.stop - self.touched.start
        return result

    @property
    def is_last(self) -> bool:
        """Whether it is the last of the trial."""
        return self.touched == self.splines

    @property
    def with_neighbours(self) -> slice:
        """Its frames, and those before and after them to which they are coupled, as far as they exist."""
        return slice(max(self.frames.start - LATER, 0), self.frames.stop + LATER)


def time_blocks(basis: MotionBasis, most: int) -> tuple[TimeBlock, ...]:
    """Split a trial into time blocks of at most `most` splines, in whole blocks of splines.

    There are at least two, except for a very short trial.
    """
    size, whole = basis.size, SPLINES_PER_BLOCK
    blocks = size // whole + 1
    block_size = max(min(most // whole, blocks // 2), 1) * whole
    # the last has more splines than the block that the one before it touches
    starts = list(range(0, size - whole, block_size)) or [0]
    ends = [*starts[1:], size]
    frames = [int(np.searchsorted(basis.first, spline)) for spline in (*starts, size)]
    return tuple(
        TimeBlock(slice(start, end), slice(start, min(end + whole, size)), slice(frames[i], frames[i + 1]))
        for i, (start, end) in enumerate(zip(starts, ends, strict=True))
    )


def halves(parts: Sequence[TimeBlock]) -> tuple[tuple[TimeBlock, ...], tuple[TimeBlock, ...]]:
    """Return the time blocks of a trial from its beginning to its middle, and from its end to its middle."""
    middle = (len(parts) + 1) // 2
    return tuple(parts[:middle]), tuple(reversed(parts[middle:]))


def joined(half: Sequence[TimeBlock]) -> list[TimeBlock]:
    """Merge neighbouring time blocks, in time or backwards, into fewer and longer ones for gradients."""
    result: list[TimeBlock] = []
    for time_block in half:
        if result and result[-1].frames.stop - result[-1].frames.start < _FRAMES_OF_GRADIENT:
            first, last = sorted((result.pop(), time_block), key=lambda block: block.frames.start)
            time_block = TimeBlock(*(slice(getattr(first, name).start, getattr(last, name).stop) for name in _SLICES))
        result.append(time_block)
    return result


def time_blocks_of_trials(bases: Sequence[MotionBasis], coordinates: int, static: int) -> list[tuple[TimeBlock, ...]]:
    """Split each trial into time blocks, for so many coordinates and static unknowns."""
    most = TOGETHER_BYTES // NormalEquations.bytes_per_spline(coordinates, static)
    if sum(basis.size for basis in bases) > most:
        most //= _SHARE
    return [time_blocks(basis, most) for basis in bases]


class KeptArrays:
    """Groups of arrays in a temporary file, which is created with the first group and deleted with this object.

    >>> kept = KeptArrays()
    >>> kept.add(np.arange(3.0), np.ones((2, 2), np.float32))
    >>> [array.tolist() for array in kept.get(0)]
    [[0.0, 1.0, 2.0], [[1.0, 1.0], [1.0, 1.0]]]
    """

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._groups: list[tuple[int, list[tuple[tuple[int, ...], np.dtype[np.generic]]]]] = []

    def add(self, *arrays: np.ndarray) -> None:
        """Append a group to the file.

        Raises:
            KinertiaError: the disk has no room for it.
        """
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115  # it lives as long as this object
            begin = self._file.seek(0, 2)
            for array in arrays:
                self._file.write(np.ascontiguousarray(array).data)
            self._file.write(bytes(_ALIGNED - self._file.tell() % _ALIGNED))
            self._file.flush()
        except OSError as error:
            raise KinertiaError(
                f"a long trial needs some 150 MB a minute in the folder for temporary files, {tempfile.gettempdir()}, "
                f"which cannot be written ({error.strerror}): make room there, or set TMPDIR (Windows: TEMP) to another"
            ) from error
        self._groups.append((begin, [(array.shape, array.dtype) for array in arrays]))

    def get(self, k: int) -> list[np.ndarray]:
        """Return group k, which is read where it is used; what is written to it does not reach the file."""
        assert self._file is not None
        begin, kinds = self._groups[k]
        sizes = [int(np.prod(shape)) * dtype.itemsize for shape, dtype in kinds]
        mapped = mmap.mmap(self._file.fileno(), sum(sizes), access=mmap.ACCESS_COPY, offset=begin)
        starts = np.cumsum([0, *sizes[:-1]]).tolist()
        return [np.ndarray(shape, dtype, mapped, start) for start, (shape, dtype) in zip(starts, kinds, strict=True)]
