"""Accumulates the normal equations of a trial's motion and of static unknowns, knot interval by knot interval."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from kinertia.model.array_types import Float3, Float4, Single4
from kinertia.model.compiled import compiled

SPLINES_PER_BLOCK = 6
"""A frame and the two after it involve seven splines: each is coupled at most to the six after it, and so at most to
the next block."""


NO_BORDER = np.zeros((2, 2, 2))[..., :1]
"""Placeholder for compiled functions, of the array type that they take: a part of a larger array. An array without
columns would be of another type, for which they would be compiled once more."""


@dataclass
class Gradient:
    """Half the sum of squares of a trial or of a time block of it, and minus its gradient.

    The derivatives are by the motion (size, c) and by the static unknowns (S,).
    """

    rhs: np.ndarray
    static_rhs: np.ndarray
    cost: float

    @classmethod
    def zero(cls, size: int, coordinates: int, static: int) -> Self:
        """Return zeros for so many splines, coordinates and static unknowns."""
        return cls(np.zeros((size, coordinates)), np.zeros(static), 0.0)

    def add(self, part: "Gradient", splines: slice) -> None:
        """Add the gradient of a time block whose frames involve these splines."""
        self.rhs[splines] += part.rhs
        self.static_rhs += part.static_rhs
        self.cost += part.cost


@dataclass
class NormalEquations(Gradient):
    """Gradient with the Gauss-Newton second derivatives: band (size, 7, c, c), border (size, c, S), static (S, S).

    Row i of the band has the blocks of splines i and i, i + 1, ... For the motion alone the border has no columns, and
    only band, `rhs` and `cost` count.
    """

    band: np.ndarray
    border: np.ndarray
    static: np.ndarray

    @classmethod
    def zero(cls, size: int, coordinates: int, static: int, bordered: bool = True) -> Self:
        """Return zeros for so many splines, coordinates and static unknowns."""
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
        """Whether the equations have a border."""
        return bool(self.border.shape[2])

    def cleared(self) -> Self:
        """Fill the arrays with zeros, and return the same equations."""
        for array in (self.rhs, self.static_rhs, self.band, self.border, self.static):
            array.fill(0.0)
        self.cost = 0.0
        return self

    @classmethod
    def bytes_per_spline(cls, coordinates: int, static: int) -> int:
        """Return the memory (bytes) of one spline, with so many coordinates and static unknowns."""
        one = cls.zero(1, coordinates, static)
        return one.band.nbytes + one.border.nbytes


class EquationsPool:
    """Pool of normal equations whose memory is reused, since allocating it takes longer than filling it.

    >>> room = EquationsPool()
    >>> first = room.zero(8, 2, 3)
    >>> room.back(first)
    >>> room.zero(8, 2, 3) is first, room.zero(8, 2, 3) is first
    (True, False)
    """

    def __init__(self) -> None:
        self._free: dict[tuple[int, int, int, bool], list[NormalEquations]] = {}

    def zero(self, size: int, coordinates: int, static: int, bordered: bool = True) -> NormalEquations:
        """Return zeros for so many splines, coordinates and static unknowns."""
        free = self._free.setdefault((size, coordinates, static, bordered), [])
        try:
            return free.pop().cleared()
        except IndexError:
            return NormalEquations.zero(size, coordinates, static, bordered)

    def back(self, normal: NormalEquations) -> None:
        """Return normal equations that are no longer needed to the pool."""
        size, coordinates = normal.rhs.shape
        self._free[size, coordinates, len(normal.static_rhs), normal.bordered].append(normal)


@compiled
def write_by_splines(values: Float3, q: Float3, qd: Float3, qdd: Float3, out: Float4 | Single4) -> None:
    """Convert derivatives by q, qd, qdd (d, r, c) to those by the coefficients of the six active splines.

    `values` (3, d, 6) are those of the splines and of their first two derivatives; `out` (d, r, 6, c) is written.
    """
    d, r, c = q.shape
    for k in range(d):
        for row in range(r):
            for i in range(6):
                place, rate, acceleration = values[0, k, i], values[1, k, i], values[2, k, i]
                for j in range(c):
                    total = place * q[k, row, j] + rate * qd[k, row, j]
                    out[k, row, i, j] = total + acceleration * qdd[k, row, j]
