"""Computes the covariance of a motion's spline coefficients near the diagonal, and variances of curves from it.

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
from kinertia.model.compiled import Float1, Float3, Single2, Single3, StridedFloat2, StridedFloat3, compiled_sums

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
        block = rhs[i : i + len(rows) // k]
        rhs[i] = rows.astype(rhs.dtype).T @ block.reshape(len(rows), -1)
    return diagonal, below


@compiled_sums
def write_variances(
    moment: Single2,
    carried: Single3,
    shaken: Single2,
    by_errors: Single2,
    covariance: StridedFloat2,
    values: Float3,
    shares: Float1,
    out: StridedFloat3,
) -> None:
    """Write variances of coordinates, rates and moments, and the covariances of moments with rates.

    Args:
        moment: (n c, S) change of the moments with one standard deviation of each independent part of the static
            unknowns, the motion following.
        carried: (6, c, S) the same of the active splines' coefficients.
        shaken: (n c, 6 c) derivatives of the moments by these, for the effect of the markers' errors on the motion.
        by_errors: (n c, 6 c) `shaken` times `covariance`.
        covariance: (6 c, 6 c) of these coefficients given the static unknowns.
        values: (3, n, 6) of the splines and of their first two derivatives.
        shares: (3,) factors on the standard deviations of coordinates, rates and accelerations due to these errors.
        out: (4, n, c), written.
    """
    _, n, c = out.shape
    size = moment.shape[1]
    alone = np.empty((6, 6))
    zero, phi = moment.dtype.type(0.0), values.astype(moment.dtype)
    for j in range(c):
        u, v, w, x, y, z = carried[0, j], carried[1, j], carried[2, j], carried[3, j], carried[4, j], carried[5, j]
        for i in range(6):
            for s in range(6):
                alone[i, s] = covariance[i * c + j, s * c + j]
        for k in range(n):
            p0, p1, p2, p3, p4, p5 = phi[0, k, 0], phi[0, k, 1], phi[0, k, 2], phi[0, k, 3], phi[0, k, 4], phi[0, k, 5]
            r0, r1, r2, r3, r4, r5 = phi[1, k, 0], phi[1, k, 1], phi[1, k, 2], phi[1, k, 3], phi[1, k, 4], phi[1, k, 5]
            place, rate, force, both, row = zero, zero, zero, zero, k * c + j
            for s in range(size):
                shift = p0 * u[s] + p1 * v[s] + p2 * w[s] + p3 * x[s] + p4 * y[s] + p5 * z[s]
                change = r0 * u[s] + r1 * v[s] + r2 * w[s] + r3 * x[s] + r4 * y[s] + r5 * z[s]
                place += shift * shift
                rate += change * change
                force += moment[row, s] * moment[row, s]
                both += moment[row, s] * change
            for s in range(6 * c):
                force += by_errors[row, s] * shaken[row, s]
            of_place, of_rate, of_both = 0.0, 0.0, 0.0
            for i in range(6):
                for s in range(6):
                    of_place += alone[i, s] * values[0, k, s] * values[0, k, i]
                    of_rate += alone[i, s] * values[1, k, s] * values[1, k, i]
                of_both += by_errors[row, i * c + j] * values[1, k, i]
            out[0, k, j], out[1, k, j] = place + shares[0] ** 2 * of_place, rate + shares[1] ** 2 * of_rate
            out[2, k, j], out[3, k, j] = force, both + shares[1] * of_both
