"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinertia.block_band import BlockBand
from kinertia.marker_terms import MarkerTerms
from kinertia.motion_basis import MotionBasis

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
    values = basis.values
    starts = np.searchsorted(basis.first, np.arange(basis.size - 4))
    root_starts = np.searchsorted(frames, starts)
    for first, (start, end) in enumerate(pairwise(starts)):
        here = slice(start, end)
        weight = values[0, here]
        pairs = (weight[:, :, None] * weight[:, None]).reshape(-1, 36)
        block = (pairs.T @ marker.per_frame[here].reshape(len(weight), -1)).reshape(6, 6, c, c)
        border = normal.border[first : first + 6]
        border[..., in_markers] += (weight.T @ marker.across[here].reshape(len(weight), -1)).reshape(6, c, -1)
        up = weight.T @ marker.gradient[here]
        rows = slice(root_starts[first], root_starts[first + 1])
        at = frames[rows]
        if at.size:
            x = sum(
                values[order, at][:, None, :, None] * part[rows][:, :, None] for order, part in enumerate((dq, dv, da))
            ).reshape(-1, 6 * c)
            block += (x.T @ x).reshape(6, c, 6, c).transpose(0, 2, 1, 3)
            border[..., in_root] += (x.T @ by_static[rows].reshape(-1, wide)).reshape(6, c, wide)
            up -= (x.T @ left[rows].ravel()).reshape(6, c)
        normal.right[first : first + 6] += up
        for a in range(6):
            normal.band[first + a, : 6 - a] += block[a, a:]
    _add_neighbours(normal.band, basis, marker.to_next)
    return normal


def _add_neighbours(band: np.ndarray, basis: MotionBasis, to_next: np.ndarray) -> None:
    """Add the terms (n - 1, c, c) of each frame with the one after it, and their transposes."""
    first, values = basis.first, basis.values[0]
    c = to_next.shape[1]
    wide = SPLINES_PER_BLOCK + 1
    # of the later frame, whose splines may begin one further on
    later = np.zeros((len(to_next), wide))
    moved = first[1:] - first[:-1]
    np.put_along_axis(later, moved[:, None] + np.arange(6), values[1:], axis=1)
    pairs = (values[:-1, :, None] * later[:, None]).reshape(len(to_next), -1)
    starts = np.searchsorted(first[:-1], np.arange(basis.size - 4))
    for begin, (start, end) in enumerate(pairwise(starts)):
        block = np.zeros((wide, wide, c, c))
        flat = to_next[start:end].reshape(end - start, -1)
        block[:6] = (pairs[start:end].T @ flat).reshape(6, wide, c, c)
        block += block.transpose(1, 0, 3, 2)
        reach = min(wide, basis.size - begin)
        for a in range(reach):
            band[begin + a, : reach - a] += block[a, a:reach]


def reduced(
    normal: NormalEquations, damping: float
) -> tuple[np.ndarray, np.ndarray, BlockBand, np.ndarray, np.ndarray]:
    """Schur complement (S, S) and right-hand side (S,) of the static unknowns, with what back-substitution needs."""
    diagonal, below = _blocks(normal.band, damping)
    band = BlockBand.factor(diagonal, below)
    b, k, _ = diagonal.shape
    size, c, s = normal.border.shape
    right = np.zeros((b * SPLINES_PER_BLOCK, c, s + 1))
    right[:size, :, :s], right[:size, :, s] = normal.border, normal.right
    solved = band.forward(right.reshape(b, k, s + 1))
    border, motion = solved[..., :s], solved[..., s:]
    flat = border.reshape(-1, s)
    return normal.static - flat.T @ flat, normal.static_right - flat.T @ motion.ravel(), band, border, motion


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
