"""Terms of the frames of a knot interval, weighed with the splines that are active, in a trial's normal equations.

The same six splines are active in all frames of an interval, and seven with the frame after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.normal_equations import SPLINES_PER_BLOCK
from kinertia.model.compiled import compiled

_TOGETHER = SPLINES_PER_BLOCK + 1


class Interval(NamedTuple):
    """Terms of the frames of a knot interval, and of the one after them.

    Attributes:
        squares: (3, f, c c) J^T W J of each frame with itself, with the next, and the latter transposed.
        across: (f + 1, c, k + 3 m) J^T W S.
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
    later = np.zeros(_TOGETHER)
    for k in range(start, end):
        own, row = values[k], k - start
        now, after = interval.squares[0, row], interval.squares[1, row]
        turned, across, gradient = interval.squares[2, row], interval.across[row], interval.gradient[row]
        for i in range(_TOGETHER):
            later[i] = 0.0
        if k + 1 < n:
            for i in range(6):
                later[first[k + 1] - at + i] = values[k + 1, i]
        for i in range(_TOGETHER):
            here = own[i] if i < 6 else 0.0
            for j in range(i, min(_TOGETHER, size - at)):
                there = own[j] if j < 6 else 0.0
                _add_rows(here * there, now, here * later[j], after, there * later[i], turned, band[at + i, j - i])
        for i in range(6):
            for j in range(c):
                right[at + i, j] += own[i] * gradient[j]
        to_border(at, own, across, border)


@compiled
def to_border(at: int, weights: np.ndarray, across: np.ndarray, border: np.ndarray) -> None:
    """Weigh terms (c, s) of a frame with the six splines from `at` on."""
    for i in range(6):
        for j in range(across.shape[0]):
            for s in range(across.shape[1]):
                border[at + i, j, s] += weights[i] * across[j, s]


@compiled
def _add_rows(
    a: float, first: np.ndarray, b: float, second: np.ndarray, c: float, third: np.ndarray, out: np.ndarray
) -> None:
    """out += a first + b second + c third, of rows (k k,) and a matrix (k, k)."""
    k = len(out)
    for i in range(k):
        for j in range(k):
            out[i, j] += a * first[i * k + j] + b * second[i * k + j] + c * third[i * k + j]
