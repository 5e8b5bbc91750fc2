"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.model.compiled import compiled

SPLINES_PER_BLOCK = 6
"""A frame and the two after it see seven splines together: each at most the six after it, and so at most the next
block."""


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
class NormalEquations:
    """Normal equations of a trial or of a stretch of it: band (size, 7, c, c), border (size, c, S), static (S, S),
    right-hand sides, and half the sum of squares. Row i of the band has the blocks of splines i and i, i + 1, ...
    """

    band: np.ndarray
    border: np.ndarray
    static: np.ndarray
    right: np.ndarray
    static_right: np.ndarray
    cost: float

    @classmethod
    def zero(cls, size: int, coordinates: int, static: int) -> NormalEquations:
        """For so many splines, coordinates and static unknowns."""
        return cls(
            np.zeros((size, SPLINES_PER_BLOCK + 1, coordinates, coordinates)),
            np.zeros((size, coordinates, static)),
            np.zeros((static, static)),
            np.zeros((size, coordinates)),
            np.zeros(static),
            0.0,
        )

    @classmethod
    def bytes_per_spline(cls, coordinates: int, static: int) -> int:
        """How much memory a spline takes, of so many coordinates and static unknowns."""
        one = cls.zero(1, coordinates, static)
        return one.band.nbytes + one.border.nbytes


def add_root(normal: NormalEquations, columns: slice, basis: MotionBasis, start: int, root: RootTerms) -> None:
    """Add the terms of the root equations at some frames, one knot interval at a time.

    Args:
        normal: zero, or with other terms.
        columns: of the static unknowns, those that the root equations depend on.
        basis: of the motion.
        start: the spline with which the normal equations begin.
        root: the terms.
    """
    left, knots = root.left, basis.first[root.frames]
    (_, _, c), wide = root.q.shape, root.static.shape[2]
    flat = root.static.reshape(-1, wide)
    normal.static[columns, columns] += flat.T @ flat
    normal.static_right[columns] -= flat.T @ left.ravel()
    normal.cost += 0.5 * float(np.square(left).sum())
    rows = by_splines(np.ascontiguousarray(basis.values[:, root.frames]), root.q, root.qd, root.qdd)
    intervals = np.unique(knots)
    ends = np.searchsorted(knots, intervals, side="right")
    for first, (begin, end) in zip(intervals - start, pairwise([0, *ends]), strict=True):
        x = rows[begin:end].reshape(-1, 6 * c)
        square = (x.T @ x).reshape(6, c, 6, c)
        for a in range(6):
            normal.band[first + a, : 6 - a] += square[a, :, a:].transpose(1, 0, 2)
        normal.border[first : first + 6, :, columns] += (x.T @ flat[6 * begin : 6 * end]).reshape(6, c, wide)
        normal.right[first : first + 6] -= (x.T @ left[begin:end].ravel()).reshape(6, c)


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
