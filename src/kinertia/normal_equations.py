"""Normal equations of a trial's motion and of what does not move, summed over frames knot interval by knot interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.block_band import BlockBand
from kinertia.motion_basis import MotionBasis


@dataclass
class NormalEquations:
    """Normal equations of a trial: band (size, 6, c, c), border (size, c, S), static (S, S), right-hand sides, and half
    the sum of squares.
    """

    band: np.ndarray
    border: np.ndarray
    static: np.ndarray
    right: np.ndarray
    static_right: np.ndarray
    cost: float


def assemble(
    normal: NormalEquations,
    basis: MotionBasis,
    marker: tuple[np.ndarray, ...],
    root: tuple[np.ndarray, ...],
    in_markers: slice,
    in_root: slice,
) -> None:
    """Sum the terms of all frames into the normal equations, one knot interval at a time.

    `in_markers` and `in_root` are the static unknowns that markers and root equations depend on.
    """
    per_frame, across, gradient, static, right, square = marker
    frames, dq, dv, da, by_static, left = root
    c, size, wide = per_frame.shape[1], normal.static.shape[0], by_static.shape[2]
    flat = by_static.reshape(-1, wide)
    normal.static[in_root, in_root] += flat.T @ flat
    normal.static[in_markers, in_markers] += static
    normal.static_right[in_root] -= flat.T @ left.ravel()
    normal.static_right[in_markers] += right
    normal.cost += 0.5 * float(square + np.square(left).sum())
    values = basis.values
    for first in np.unique(basis.first):
        here = np.flatnonzero(basis.first == first)
        weight = values[0, here]
        pairs = (weight[:, :, None] * weight[:, None]).reshape(len(here), 36)
        block = (pairs.T @ per_frame[here].reshape(len(here), -1)).reshape(6, 6, c, c)
        border = np.zeros((6, c, size))
        border[:, :, in_markers] = (weight.T @ across[here].reshape(len(here), -1)).reshape(6, c, -1)
        up = weight.T @ gradient[here]
        rows = np.flatnonzero(np.isin(frames, here, assume_unique=True))
        if rows.size:
            at = frames[rows]
            parts = [
                values[order, at][:, None, :, None] * part[rows][:, :, None] for order, part in enumerate((dq, dv, da))
            ]
            x = np.sum(parts, axis=0).reshape(len(rows) * 6, 6 * c)
            block += (x.T @ x).reshape(6, c, 6, c).transpose(0, 2, 1, 3)
            border[:, :, in_root] += (x.T @ by_static[rows].reshape(-1, wide)).reshape(6, c, wide)
            up -= (x.T @ left[rows].ravel()).reshape(6, c)
        normal.border[first : first + 6] += border
        normal.right[first : first + 6] += up
        for a in range(6):
            normal.band[first + a, : 6 - a] += block[a, a:]


def reduced(
    normal: NormalEquations, damping: float
) -> tuple[np.ndarray, np.ndarray, BlockBand, np.ndarray, np.ndarray]:
    """Schur complement (S, S) and right-hand side (S,) of the static unknowns, with what back-substitution needs."""
    diagonal, below = _blocks(normal.band, damping)
    band = BlockBand.factor(diagonal, below)
    b, k, _ = diagonal.shape
    size, c, s = normal.border.shape
    right = np.zeros((b * 5, c, s + 1))
    right[:size, :, :s], right[:size, :, s] = normal.border, normal.right
    solved = band.forward(right.reshape(b, k, s + 1))
    border, motion = solved[..., :s], solved[..., s:]
    flat = border.reshape(-1, s)
    return normal.static - flat.T @ flat, normal.static_right - flat.T @ motion.ravel(), band, border, motion


def _blocks(band: np.ndarray, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of five splines: diagonal (b, 5 c, 5 c) and below it (b - 1, 5 c, 5 c)."""
    size, _, c, _ = band.shape
    b = -(-size // 5)
    padded = np.zeros((5 * b + 5, 6, c, c))
    padded[:size] = band
    diagonal, below = np.zeros((b, 5, c, 5, c)), np.zeros((b, 5, c, 5, c))
    for i in range(5):
        rows = padded[i : 5 * b : 5]
        for offset in range(6):
            j = i + offset
            if j < 5:
                diagonal[:, i, :, j, :] += rows[:, offset]
                if offset:
                    diagonal[:, j, :, i, :] += rows[:, offset].transpose(0, 2, 1)
            else:
                below[:, j - 5, :, i, :] = rows[:, offset].transpose(0, 2, 1)
    diagonal = diagonal.reshape(b, 5 * c, 5 * c)
    inside = np.arange(5 * b * c) < size * c
    entries = np.einsum("bii->bi", diagonal)
    entries *= 1.0 + damping
    entries += np.where(inside, 0.0, 1.0).reshape(b, -1)
    return diagonal, below.reshape(b, 5 * c, 5 * c)[:-1]
