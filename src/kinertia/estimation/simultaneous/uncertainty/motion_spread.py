"""Computes the covariance of a motion's spline coefficients near the diagonal, and what they owe to static unknowns.

Only the blocks near the diagonal are needed, since six splines are active in any frame. They come from the block-banded
factor by Takahashi's recursion, from the middle of a trial outwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.block_tridiagonal import BlockBand, solve_lower
from kinertia.estimation.simultaneous.linear_algebra.elimination import Factored
from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import SPLINES_PER_BLOCK

_COLUMNS = 160
"""Number of columns of a product at once: some are zero in most rows."""


@dataclass(frozen=True)
class EndSpread:
    """Uncertainty of the splines of one block, as in `MotionSpread`: (k, k) and (k, S)."""

    diagonal: np.ndarray
    carried: np.ndarray

    @classmethod
    def of_middle(cls, middle: Factored, root: np.ndarray) -> EndSpread:
        """Compute the uncertainty of the block in the middle of a trial."""
        carried = _times_root(middle.border, root)
        diagonal, _ = _recursion(middle.band, carried, None)
        return cls(diagonal[0], carried[0])


@dataclass(frozen=True)
class MotionSpread:
    """Uncertainty of the spline coefficients that a time block touches, and their dependence on the static unknowns.

    Attributes:
        start: the first of the splines.
        pairs: (b, 2 k, 2 k) covariance of every two neighbouring blocks of SPLINES_PER_BLOCK splines, given the static
            unknowns.
        carried: (splines, c, r) their change with one standard deviation of each independent part of the static
            unknowns.
    """

    start: int
    pairs: np.ndarray
    carried: np.ndarray

    @classmethod
    def of(
        cls, part: Factored, time_block: TimeBlock, root: np.ndarray, end: EndSpread, needed: slice
    ) -> tuple[MotionSpread, EndSpread] | None:
        """Compute the uncertainty of a time block, and of the block of splines with which the next time block ends.

        Args:
            part: the eliminated splines.
            time_block: theirs.
            root: (S, r) root of the static unknowns' covariance.
            end: of the block of splines with which the time block ends.
            needed: splines of the trial. Blocks beyond them are left out; if all are, there is no result.
        """
        start, blocks = time_block.touched.start, len(part.border)
        # six splines that are one block are still the first of a pair
        first, last = ((spline - start) // SPLINES_PER_BLOCK for spline in (needed.start, needed.stop))
        beyond = max(blocks - last if part.backwards else first, 0)
        if beyond >= blocks:
            return None
        carried = np.concatenate([_times_root(part.border[beyond:], root), end.carried[None]])
        band = BlockBand(part.band.diagonal[beyond:], part.band.below[beyond:])
        diagonal, below = _recursion(band, carried, end.diagonal)
        other, k = EndSpread(diagonal[0], carried[0]), diagonal.shape[1]
        if part.backwards:
            diagonal, carried, below = diagonal[::-1], carried[::-1], below[::-1].transpose(0, 2, 1)
        else:
            start += beyond * SPLINES_PER_BLOCK
        pairs = np.empty((len(below), 2 * k, 2 * k))
        pairs[:, :k, :k], pairs[:, :k, k:] = diagonal[:-1], below.transpose(0, 2, 1)
        pairs[:, k:, :k], pairs[:, k:, k:] = below, diagonal[1:]
        return cls(start, pairs, carried.reshape(-1, k // SPLINES_PER_BLOCK, root.shape[1])), other

    def active(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return covariance (6 c, 6 c) and dependence (6, c, r) of the trial's six splines from `first` on."""
        block, offset = divmod(first - self.start, SPLINES_PER_BLOCK)
        c = self.carried.shape[1]
        here = slice(offset * c, (offset + 6) * c)
        return self.pairs[block, here, here], self.carried[first - self.start : first - self.start + 6]


def _times_root(border: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Multiply a border (b, k, S) by a root (S, r), many rows of whose columns are zero."""
    flat, precise = border.reshape(-1, len(root)), root.astype(border.dtype)
    result = np.empty((*border.shape[:2], root.shape[1]), border.dtype)
    into = result.reshape(len(flat), -1)
    for start in range(0, root.shape[1], _COLUMNS):
        columns = precise[:, start : start + _COLUMNS]
        rows = np.flatnonzero(columns.any(axis=1))
        some = slice(rows[0], rows[-1] + 1)
        np.matmul(flat[:, some], columns[some], out=into[:, start : start + _COLUMNS])
    return result


def _recursion(band: BlockBand, rhs: np.ndarray, after: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Compute blocks of the inverse of L L^T, and L^-T times a right-hand side.

    Args:
        band: L, of b blocks.
        rhs: (b, k, S), replaced by the solution; if the matrix continues, (b + 1, k, S) with the solution's next block.
        after: (k, k) the next block of the inverse on its diagonal; None if the matrix does not continue.

    Returns:
        The blocks of the inverse on its diagonal and below it, as many on the diagonal as in `rhs`.
    """
    b, k, _ = band.diagonal.shape
    diagonal, below = np.empty((len(rhs), k, k)), np.empty((len(rhs) - 1, k, k))
    if after is not None:
        diagonal[b] = after
    for i in range(b - 1, -1, -1):
        half = np.eye(k)
        solve_lower(band.diagonal[i], half)
        diagonal[i], rows = half.T @ half, half
        if i + 1 < len(rhs):
            reach = band.below[i] @ half
            below[i] = -diagonal[i + 1] @ reach
            diagonal[i] -= reach.T @ below[i]
            rows = np.concatenate([half, -reach])
        own = rhs[i : i + len(rows) // k]
        rhs[i] = rows.astype(rhs.dtype).T @ own.reshape(len(rows), -1)
    return diagonal, below
