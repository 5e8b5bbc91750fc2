"""Terms of the frames of a knot interval, weighed with the splines that are active, in a trial's normal equations.

The same six splines are active in all frames of an interval, and seven with the two frames after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.marker_errors import LATER
from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK
from kinertia.model.compiled import compiled

_TOGETHER = SPLINES_PER_BLOCK + 1


class Interval(NamedTuple):
    """Terms of the frames of a knot interval, and of the two after them.

    Attributes:
        squares: (5, f, c c) J^T W J of each frame with itself, with the next, the latter transposed, and the same with
            the second after it.
        across: (f + 2, c, s) J^T W S.
        gradient: (f, c) J^T W r.
    """

    squares: np.ndarray
    across: np.ndarray
    gradient: np.ndarray


@compiled
def longest_run(first: np.ndarray) -> int:
    """The most frames of an interval."""
    longest, run = 1, 1
    for k in range(1, len(first)):
        run = run + 1 if first[k] == first[k - 1] else 1
        longest = max(longest, run)
    return longest


@compiled
def to_splines(
    first: np.ndarray,
    values: np.ndarray,
    start: int,
    end: int,
    interval: Interval,
    band: np.ndarray,
    border: np.ndarray,
    right: np.ndarray,
) -> None:
    """Weigh the terms of an interval with the splines that are active, two by two."""
    n, size, c, at = len(first), len(band), right.shape[1], first[start]
    own, weights = np.zeros((1 + LATER, _TOGETHER)), np.empty(1 + 2 * LATER)
    for k in range(start, end):
        row = k - start
        own[:] = 0.0
        for later in range(min(LATER, n - 1 - k) + 1):
            for i in range(6):
                own[later, first[k + later] - at + i] = values[k + later, i]
        for i in range(_TOGETHER):
            for j in range(i, min(_TOGETHER, size - at)):
                weights[0] = own[0, i] * own[0, j]
                for later in range(1, LATER + 1):
                    weights[2 * later - 1] = own[0, i] * own[later, j]
                    weights[2 * later] = own[later, i] * own[0, j]
                _add_rows(weights, interval.squares[:, row], band[at + i, j - i])
        for i in range(6):
            for j in range(c):
                right[at + i, j] += own[0, i] * interval.gradient[row, j]
        to_border(at, values[k], interval.across[row], border)


@compiled
def to_border(at: int, weights: np.ndarray, across: np.ndarray, border: np.ndarray) -> None:
    """Weigh terms (c, s) of a frame with the six splines from `at` on."""
    for i in range(6):
        for j in range(across.shape[0]):
            for s in range(across.shape[1]):
                border[at + i, j, s] += weights[i] * across[j, s]


@compiled
def _add_rows(weights: np.ndarray, rows: np.ndarray, out: np.ndarray) -> None:
    """out (k, k) += the sum of the rows (r, k k) in these weights (r,)."""
    k = len(out)
    for r in range(len(weights)):
        weight = weights[r]
        if weight != 0.0:
            for i in range(k):
                for j in range(k):
                    out[i, j] += weight * rows[r, i * k + j]
