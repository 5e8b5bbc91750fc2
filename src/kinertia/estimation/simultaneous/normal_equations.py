"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.model.compiled import compiled

SPLINES_PER_BLOCK = 6
"""A frame and the two after it see seven splines together: each at most the six after it, and so at most the next
block."""


NO_BORDER = np.zeros((2, 2, 2))[..., :1]
"""For compiled functions, of the kind of array that they take: a part of a larger one. One without columns would be of
another kind, for which they would be compiled once more."""


@dataclass(frozen=True)
class RootTerms:
    """Residuals of the root equations at the dynamic frames and their derivatives, each over its deviation.

    Attributes:
        frames: (d,) indices.
        q, qd, qdd: (d, 6, c) by the coordinates that move, and their rates.
        static: (d, 6, s) by the static unknowns that they depend on.
        left: (d, 6) residuals.
    """

    frames: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    static: np.ndarray
    left: np.ndarray


@dataclass
class Gradient:
    """Half the sum of squares of a trial or of a stretch of it, and where it falls: minus its derivatives by the motion
    (size, c) and by the static unknowns (S,).
    """

    right: np.ndarray
    static_right: np.ndarray
    cost: float

    @classmethod
    def zero(cls, size: int, coordinates: int, static: int) -> Self:
        """For so many splines, coordinates and static unknowns."""
        return cls(np.zeros((size, coordinates)), np.zeros(static), 0.0)

    def add(self, part: Gradient, splines: slice) -> None:
        """Add the gradient of a stretch whose frames involve these splines."""
        self.right[splines] += part.right
        self.static_right += part.static_right
        self.cost += part.cost


@dataclass
class NormalEquations(Gradient):
    """With the second derivatives of Gauss and Newton: band (size, 7, c, c), border (size, c, S), static (S, S). Row i
    of the band has the blocks of splines i and i, i + 1, ... Of the motion alone the border has no columns, and only
    band and `right` count.
    """

    band: np.ndarray
    border: np.ndarray
    static: np.ndarray

    @classmethod
    def zero(cls, size: int, coordinates: int, static: int, bordered: bool = True) -> Self:
        """For so many splines, coordinates and static unknowns."""
        return cls(
            np.zeros((size, coordinates)),
            np.zeros(static),
            0.0,
            np.zeros((size, SPLINES_PER_BLOCK + 1, coordinates, coordinates)),
            np.zeros((size, coordinates, static if bordered else 0)),
            np.zeros((static, static)),
        )

    @property
    def bordered(self) -> bool:
        """Whether they have a border."""
        return bool(self.border.shape[2])

    def cleared(self) -> Self:
        """The same arrays, filled with zeros."""
        for array in (self.right, self.static_right, self.band, self.border, self.static):
            array.fill(0.0)
        self.cost = 0.0
        return self

    @classmethod
    def bytes_per_spline(cls, coordinates: int, static: int) -> int:
        """How much memory a spline takes, of so many coordinates and static unknowns."""
        one = cls.zero(1, coordinates, static)
        return one.band.nbytes + one.border.nbytes


class UsedAgain:
    """Normal equations whose memory is used again: to ask the system for as much takes longer than to fill it.

    >>> room = UsedAgain()
    >>> first = room.zero(8, 2, 3)
    >>> room.back(first)
    >>> room.zero(8, 2, 3) is first, room.zero(8, 2, 3) is first
    (True, False)
    """

    def __init__(self) -> None:
        self._free: dict[tuple[int, int, int, bool], list[NormalEquations]] = {}

    def zero(self, size: int, coordinates: int, static: int, bordered: bool = True) -> NormalEquations:
        """Zeros for so many splines, coordinates and static unknowns."""
        free = self._free.setdefault((size, coordinates, static, bordered), [])
        try:
            return free.pop().cleared()
        except IndexError:
            return NormalEquations.zero(size, coordinates, static, bordered)

    def back(self, normal: NormalEquations) -> None:
        """Take back what nobody needs any more."""
        size, coordinates = normal.right.shape
        self._free[size, coordinates, len(normal.static_right), normal.bordered].append(normal)


def add_root(into: NormalEquations, columns: slice, basis: MotionBasis, start: int, root: RootTerms) -> None:
    """Add the terms of the root equations at some frames, one knot interval at a time.

    Args:
        into: zero, or with other terms.
        columns: of the static unknowns, those that the root equations depend on.
        basis: of the motion.
        start: the spline with which the normal equations begin.
        root: the terms.
    """
    left, knots = root.left, basis.first[root.frames]
    (_, _, c), wide = root.q.shape, root.static.shape[2]
    flat = root.static.reshape(-1, wide)
    into.static_right[columns] -= flat.T @ left.ravel()
    into.cost += 0.5 * float(np.square(left).sum())
    intervals, begins = np.unique(knots, return_index=True)
    values = np.ascontiguousarray(basis.values[:, root.frames])
    pulls = [(left[:, None] @ by)[:, 0] for by in (root.q, root.qd, root.qdd)]
    for i in range(6):
        each = sum(value[:, i, None] * pull for value, pull in zip(values, pulls, strict=True))
        into.right[intervals - start + i] -= np.add.reduceat(each, begins, axis=0)
    if into.bordered:
        into.static[columns, columns] += flat.T @ flat
    rows = by_splines(values, root.q, root.qd, root.qdd)
    border = into.border[..., columns] if into.bordered else NO_BORDER
    _add_intervals(
        rows.reshape(-1, 6 * c),
        flat,
        intervals - start,
        6 * np.append(begins, len(knots)),
        into.band,
        border,
        into.bordered,
    )


@compiled
def _add_intervals(
    rows: np.ndarray,
    static: np.ndarray,
    first: np.ndarray,
    ends: np.ndarray,
    band: np.ndarray,
    border: np.ndarray,
    bordered: bool,
) -> None:
    """Add squares of derivatives by the coefficients of the active splines, rows (6 d, 6 c), and across those by static
    unknowns (6 d, s) if `bordered`; rows of an interval begin and end at `ends`, its splines begin at `first`.
    """
    c = band.shape[2]
    for k in range(len(first)):
        own, at = rows[ends[k] : ends[k + 1]], first[k]
        square = np.dot(own.T, own)
        for i in range(6):
            for row in range(c):
                for j in range(i, 6):
                    for column in range(c):
                        band[at + i, j - i, row, column] += square[i * c + row, j * c + column]
        if not bordered:
            continue
        across = np.dot(own.T, static[ends[k] : ends[k + 1]])
        for i in range(6):
            for row in range(c):
                for s in range(across.shape[1]):
                    border[at + i, row, s] += across[i * c + row, s]


@compiled
def by_splines(values: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """(d, r, 6, c) derivatives by the coefficients of the six active splines, from those by q, qd, qdd (d, r, c).

    `values` (3, d, 6) are those of the splines and of their first two derivatives.
    """
    d, r, c = q.shape
    result = np.empty((d, r, 6, c))
    for k in range(d):
        for row in range(r):
            for i in range(6):
                place, rate, acceleration = values[0, k, i], values[1, k, i], values[2, k, i]
                for j in range(c):
                    total = place * q[k, row, j] + rate * qd[k, row, j]
                    result[k, row, i, j] = total + acceleration * qdd[k, row, j]
    return result
