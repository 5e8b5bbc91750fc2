"""Splits a trial into stretches of frames: for two threads, and to bound the memory of a long one.

Splines see only their neighbours. Those of one stretch can be eliminated as soon as all frames that touch them are
summed, and what follows needs of them one block only (`elimination`). The frames of a stretch touch its own splines and
the first block of the next stretch, which gets its other terms from its own frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.marker_errors import LATER
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK, NormalEquations

TOGETHER_BYTES = 2**27
"""Trials whose normal equations are together no larger, a minute of gait, are two stretches each. Beyond it memory
counts for more than time. What is made of them takes some four times as much in passing."""
_SHARE = 16
"""Of it that a stretch of longer trials takes."""
_FRAMES_OF_GRADIENT = 2000
"""A stretch for gradients, which need less memory, has about so many frames: fewer would take longer."""


_SLICES = ("splines", "touched", "frames")


@dataclass(frozen=True)
class Stretch:
    """Neighbouring splines of a trial, and the frames whose first active spline is one of them.

    Attributes:
        splines: its own.
        touched: those that its frames touch: its own and, before the trial's last stretch, a block of the next.
        frames: indices.
    """

    splines: slice
    touched: slice
    frames: slice

    @classmethod
    def whole(cls, basis: MotionBasis) -> Stretch:
        """All of a trial."""
        return cls(slice(0, basis.size), slice(0, basis.size), slice(0, len(basis.first)))

    @property
    def size(self) -> int:
        """How many splines its frames touch."""
        result: int = self.touched.stop - self.touched.start
        return result

    @property
    def is_last(self) -> bool:
        """Nothing comes after it."""
        return self.touched == self.splines

    @property
    def with_neighbours(self) -> slice:
        """Its frames, and those before and after them that they meet, where there are such."""
        return slice(max(self.frames.start - LATER, 0), self.frames.stop + LATER)


def stretches(basis: MotionBasis, most: int) -> tuple[Stretch, ...]:
    """The trial in whole blocks of at most so many splines, at least two stretches; one if it has hardly any blocks."""
    size, whole = basis.size, SPLINES_PER_BLOCK
    blocks = size // whole + 1
    each = max(min(most // whole, blocks // 2), 1) * whole
    # the last has more than the block that the one before it touches
    starts = list(range(0, size - whole, each)) or [0]
    ends = [*starts[1:], size]
    frames = np.searchsorted(basis.first, [*starts, size]).tolist()
    return tuple(
        Stretch(slice(start, end), slice(start, min(end + whole, size)), slice(frames[i], frames[i + 1]))
        for i, (start, end) in enumerate(zip(starts, ends, strict=True))
    )


def halves(parts: Sequence[Stretch]) -> tuple[tuple[Stretch, ...], tuple[Stretch, ...]]:
    """The stretches of a trial from its beginning to its middle, and from its end to its middle."""
    middle = (len(parts) + 1) // 2
    return tuple(parts[:middle]), tuple(reversed(parts[middle:]))


def joined(half: Sequence[Stretch]) -> list[Stretch]:
    """Neighbouring stretches, in time or backwards, as fewer and longer ones for gradients."""
    result: list[Stretch] = []
    for stretch in half:
        if result and result[-1].frames.stop - result[-1].frames.start < _FRAMES_OF_GRADIENT:
            first, last = sorted((result.pop(), stretch), key=lambda each: each.frames.start)
            stretch = Stretch(*(_both(getattr(first, name), getattr(last, name)) for name in _SLICES))
        result.append(stretch)
    return result


def _both(first: slice, last: slice) -> slice:
    return slice(first.start, last.stop)


def stretches_of_trials(bases: Sequence[MotionBasis], coordinates: int, static: int) -> list[tuple[Stretch, ...]]:
    """Each trial's, for so many coordinates and static unknowns."""
    most = TOGETHER_BYTES // NormalEquations.bytes_per_spline(coordinates, static)
    if sum(basis.size for basis in bases) > most:
        most //= _SHARE
    return [stretches(basis, most) for basis in bases]
