"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinertia.estimation.simultaneous.block_tridiagonal import BlockBand
from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.model.compiled import compiled

SPLINES_PER_BLOCK = 6
"""Two neighbouring frames see seven splines together: each at most the six after it, and so at most the next block."""


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
    """Normal equations of a trial: band (size, 7, c, c), border (size, c, S), static (S, S), right-hand sides, and half
    the sum of squares. Row i of the band has the blocks of splines i and i, i + 1, ...
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


def add_root(normal: NormalEquations, columns: slice, basis: MotionBasis, root: RootTerms) -> None:
    """Add the terms of the root equations, one knot interval at a time.

    Args:
        normal: zero, or with other terms.
        columns: of the static unknowns, those that the root equations depend on.
        basis: of the motion.
        root: the terms.
    """
    left, size = root.left, basis.size
    (_, _, c), wide = root.q.shape, root.static.shape[2]
    flat = root.static.reshape(-1, wide)
    normal.static[columns, columns] += flat.T @ flat
    normal.static_right[columns] -= flat.T @ left.ravel()
    normal.cost += 0.5 * float(np.square(left).sum())
    rows = by_splines(np.ascontiguousarray(basis.values[:, root.frames]), root.q, root.qd, root.qdd)
    starts = np.searchsorted(basis.first[root.frames], np.arange(size - 4))
    for first, (start, end) in enumerate(pairwise(starts)):
        if start == end:
            continue
        x = rows[start:end].reshape(-1, 6 * c)
        square = (x.T @ x).reshape(6, c, 6, c)
        for a in range(6):
            normal.band[first + a, : 6 - a] += square[a, :, a:].transpose(1, 0, 2)
        normal.border[first : first + 6, :, columns] += (x.T @ flat[6 * start : 6 * end]).reshape(6, c, wide)
        normal.right[first : first + 6] -= (x.T @ left[start:end].ravel()).reshape(6, c)


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


@dataclass(frozen=True)
class Reduced:
    """Normal equations with the motion eliminated.

    Attributes:
        information: (S, S) on the static unknowns (Schur complement).
        right: (S,) its right-hand side.
        band: factor L of the motion's own normal matrix.
        border: (b, k, S) L^-1 times the border.
        motion: (b, k, 1) L^-1 times the motion's right-hand side.
    """

    information: np.ndarray
    right: np.ndarray
    band: BlockBand
    border: np.ndarray
    motion: np.ndarray


def reduced(normal: NormalEquations, damping: float) -> Reduced:
    """Eliminate the motion, with its diagonal raised by this share."""
    diagonal, below = _blocks(normal.band, damping)
    band = BlockBand.factor(diagonal, below)
    b, k, _ = diagonal.shape
    size, c, s = normal.border.shape
    right = np.zeros((b * SPLINES_PER_BLOCK, c, s + 1))
    right[:size, :, :s], right[:size, :, s] = normal.border, normal.right
    solved = band.forward(right.reshape(b, k, s + 1))
    border, motion = solved[..., :s], solved[..., s:]
    flat = border.reshape(-1, s)
    information, moved = normal.static - flat.T @ flat, normal.static_right - flat.T @ motion.ravel()
    return Reduced(information, moved, band, border, motion)


def _blocks(band: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Diagonal blocks (b, k, k), k = c SPLINES_PER_BLOCK, and those below (b - 1, k, k); one more than just fits."""
    size, wide, c, _ = band.shape
    each = SPLINES_PER_BLOCK
    b = size // each + 1
    padded = np.zeros((each * b + each, wide, c, c))
    padded[:size] = band
    diagonal, below = np.zeros((b, each, c, each, c)), np.zeros((b, each, c, each, c))
    for i in range(each):
        rows = padded[i : each * b : each]
        for offset in range(wide):
            j = i + offset
            if j < each:
                diagonal[:, i, :, j, :] += rows[:, offset]
                if offset:
                    diagonal[:, j, :, i, :] += rows[:, offset].transpose(0, 2, 1)
            else:
                below[:, j - each, :, i, :] = rows[:, offset].transpose(0, 2, 1)
    k = each * c
    diagonal = diagonal.reshape(b, k, k)
    inside = np.arange(b * k) < size * c
    entries = np.einsum("bii->bi", diagonal)
    entries *= 1.0 + damping
    entries += np.where(inside, 0.0, 1.0).reshape(b, -1)
    return diagonal, below.reshape(b, k, k)[:-1]
