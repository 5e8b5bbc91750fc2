"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinertia.estimation.simultaneous.block_tridiagonal import BlockBand
from kinertia.estimation.simultaneous.marker_terms import MarkerTerms
from kinertia.estimation.simultaneous.motion_basis import MotionBasis

SPLINES_PER_BLOCK = 6
"""Two neighbouring frames see seven splines together: each at most the six after it, and so at most the next block."""


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


def assemble(
    basis: MotionBasis,
    marker: MarkerTerms,
    root: tuple[np.ndarray, ...],
    in_markers: slice,
    in_root: slice,
) -> NormalEquations:
    """Sum the terms of all frames into normal equations, one knot interval at a time.

    `in_markers` and `in_root` are the static unknowns that markers and root equations depend on.
    """
    frames, dq, dv, da, by_static, left = root
    c, wide = marker.gradient.shape[1], by_static.shape[2]
    normal = NormalEquations.zero(basis.size, c, max(in_markers.stop, in_root.stop))
    flat = by_static.reshape(-1, wide)
    normal.static[in_root, in_root] += flat.T @ flat
    normal.static[in_markers, in_markers] += marker.static
    normal.static_right[in_root] -= flat.T @ left.ravel()
    normal.static_right[in_markers] += marker.static_gradient
    normal.cost += 0.5 * float(marker.square + np.square(left).sum())
    values, size = basis.values, basis.size
    rows = by_splines(values[:, frames], (dq, dv, da))
    neighbours = _neighbours(basis)
    starts = np.searchsorted(basis.first, np.arange(size - 4))
    root_starts = np.searchsorted(frames, starts)
    next_starts = np.minimum(starts, len(marker.to_next))
    for first, (start, end) in enumerate(pairwise(starts)):
        here, dynamic, pairs = (slice(each[first], each[first + 1]) for each in (starts, root_starts, next_starts))
        weight = values[0, here]
        block = np.zeros((7, 7, c, c))
        block[:6] = (neighbours[pairs].T @ marker.to_next[pairs].reshape(-1, c * c)).reshape(6, 7, c, c)
        block += block.transpose(1, 0, 3, 2)
        squares = (weight[:, :, None] * weight[:, None]).reshape(-1, 36)
        block[:6, :6] += (squares.T @ marker.per_frame[here].reshape(-1, c * c)).reshape(6, 6, c, c)
        border, right = normal.border[first : first + 6], normal.right[first : first + 6]
        border[..., in_markers] += (weight.T @ marker.across[here].reshape(end - start, -1)).reshape(6, c, -1)
        right += weight.T @ marker.gradient[here]
        x = rows[dynamic].reshape(-1, 6 * c)
        if len(x):
            block[:6, :6] += (x.T @ x).reshape(6, c, 6, c).transpose(0, 2, 1, 3)
            border[..., in_root] += (x.T @ by_static[dynamic].reshape(-1, wide)).reshape(6, c, wide)
            right -= (x.T @ left[dynamic].ravel()).reshape(6, c)
        reach = min(7, size - first)
        for a in range(reach):
            normal.band[first + a, : reach - a] += block[a, a:reach]
    return normal


def by_splines(values: np.ndarray, parts: tuple[np.ndarray, ...]) -> np.ndarray:
    """(d, r, 6, c) derivatives by the coefficients of the six active splines, from those by q, qd, qdd (d, r, c)."""
    result: np.ndarray = values[0][:, None, :, None] * parts[0][:, :, None]
    for value, part in zip(values[1:], parts[1:], strict=True):
        result += value[:, None, :, None] * part[:, :, None]
    return result


def _neighbours(basis: MotionBasis) -> np.ndarray:
    """(n - 1, 42) products of the six splines at a frame and the seven, from the same one on, at the frame after it."""
    values, first = basis.values[0], basis.first
    later = np.zeros((len(first) - 1, SPLINES_PER_BLOCK + 1))
    np.put_along_axis(later, np.diff(first)[:, None] + np.arange(6), values[1:], axis=1)
    result: np.ndarray = (values[:-1, :, None] * later[:, None]).reshape(len(later), -1)
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
