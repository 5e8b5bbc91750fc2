"""Accumulates the normal equations of motion and static unknowns; eliminates those that only markers depend on.

The same six splines are active in all frames of an interval, and seven with the two frames after it.

They are many, and always have a prior. The remaining unknowns, body and calibration, may come near the limit of what is
physically possible, where the logarithm of a second moment becomes undetermined and its information may round to below
zero.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import cholesky, lu_factor, lu_solve, solve_triangular

from kinertia.estimation.simultaneous.markers.marker_errors import LATER
from kinertia.model.compiled import Float3, Float4, Single4, compiled, inlined, part

SPLINES_PER_BLOCK = 6
"""A frame and the two after it involve seven splines: each is coupled at most to the six after it, and so at most to
the next block."""
NO_BORDER = np.zeros((2, 2, 2))[..., :1]
"""Placeholder for compiled functions, of the array type that they take: a part of a larger array. An array without
columns would be of another type, for which they would be compiled once more."""
_TOGETHER = SPLINES_PER_BLOCK + 1
LEAST_INFORMATION = 0.01
"""On every unknown by its prior, so that none has a standard deviation above ten. Where the data favour a second moment
below zero, its logarithm falls until neither data nor prior hold it; what is computed from its variance is then noise,
and its exponential may have any size."""
_ROUNDED = 0.5
"""Share of that."""


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
        single = cls.zero(1, coordinates, static)
        return single.band.nbytes + single.border.nbytes


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


class Interval(NamedTuple):
    """Terms of the frames of a knot interval, and of the two frames after them.

    Attributes:
        squares: (5 f, c c) J^T W J of each frame with itself, f frames with the next, the latter transposed, and the
            same with the second after it.
        across: (f + 2, c, s) J^T W S.
        gradient: (f, c) J^T W r.
    """

    squares: np.ndarray
    across: np.ndarray
    gradient: np.ndarray


@part
def longest_run(first: np.ndarray) -> int:
    """Return the largest number of frames in an interval."""
    longest, run = 1, 1
    for k in range(1, len(first)):
        run = run + 1 if first[k] == first[k - 1] else 1
        longest = max(longest, run)
    return longest


@part
def to_splines(
    first: np.ndarray,
    values: np.ndarray,
    start: int,
    end: int,
    interval: Interval,
    reach: np.ndarray,
    band: np.ndarray,
    border: np.ndarray,
    rhs: np.ndarray,
    bordered: bool,
) -> None:
    """Weight the terms of an interval with pairs of the active splines.

    `reach` (c, r, 2) are the runs of columns of S that each coordinate is coupled to. Terms across the frames after the
    interval are left for the next one. The border is left out if not `bordered`.
    """
    n, size, c, at, most = len(first), len(band), rhs.shape[1], first[start], len(interval.gradient)
    spline_values = np.zeros((1 + LATER, most, _TOGETHER))
    for k in range(start, end):
        for later in range(min(LATER, n - 1 - k) + 1):
            for i in range(6):
                spline_values[later, k - start, first[k + later] - at + i] = values[k + later, i]
        for i in range(6):
            for j in range(c):
                rhs[at + i, j] += spline_values[0, k - start, i] * interval.gradient[k - start, j]
    products, pair = np.dot(_pair_weights(spline_values), interval.squares), 0
    for i in range(_TOGETHER):
        for j in range(i, _TOGETHER):
            if at + j < size:
                block = band[at + i, j - i]
                for row in range(c):
                    for column in range(c):
                        block[row, column] += products[pair, row * c + column]
            pair += 1
    for j in range(c if bordered else 0):
        for run in range(reach.shape[1]):
            begin, stop = reach[j, run, 0], reach[j, run, 1]
            if begin < stop:
                for i in range(6):
                    _weigh(
                        spline_values[0, :, i],
                        end - start,
                        interval.across[:, j, begin:stop],
                        border[at + i, j, begin:stop],
                    )
                _pass_on(end - start, interval.across[:, j, begin:stop])


@inlined
def _weigh(weights: np.ndarray, count: int, across: np.ndarray, border: np.ndarray) -> None:
    """Add the weighted terms (f, s) of so many frames, four at a time."""
    k = 0
    while k + 4 <= count:
        w0, w1, w2, w3 = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        for s in range(len(border)):
            border[s] += w0 * across[k, s] + w1 * across[k + 1, s] + w2 * across[k + 2, s] + w3 * across[k + 3, s]
        k += 4
    while k < count:
        for s in range(len(border)):
            border[s] += weights[k] * across[k, s]
        k += 1


@inlined
def _pass_on(count: int, across: np.ndarray) -> None:
    """Move the terms of the frames after an interval of `count` frames to the next interval, followed by zeros."""
    for row in range(min(count + LATER, len(across))):
        for s in range(across.shape[1]):
            across[row, s] = across[count + row, s] if row < LATER else 0.0


@part
def _pair_weights(spline_values: np.ndarray) -> np.ndarray:
    """Compute weights (28, 5 f) of `Interval.squares` for each pair of splines, the second not before the first.

    They come from the splines (3, f, 7) in each frame and in the two after it.
    """
    most, pair = spline_values.shape[1], 0
    weights = np.empty((_TOGETHER * (_TOGETHER + 1) // 2, (1 + 2 * LATER) * most))
    for i in range(_TOGETHER):
        for j in range(i, _TOGETHER):
            for k in range(most):
                weights[pair, k] = spline_values[0, k, i] * spline_values[0, k, j]
                for later in range(1, LATER + 1):
                    weights[pair, (2 * later - 1) * most + k] = spline_values[0, k, i] * spline_values[later, k, j]
                    weights[pair, 2 * later * most + k] = spline_values[later, k, i] * spline_values[0, k, j]
            pair += 1
    return weights


@part
def to_border(at: int, weights: np.ndarray, across: np.ndarray, border: np.ndarray) -> None:
    """Weight terms (c, s) of a frame with the six splines from `at` on."""
    for i in range(6):
        for j in range(across.shape[0]):
            for s in range(across.shape[1]):
                border[at + i, j, s] += weights[i] * across[j, s]


@dataclass(frozen=True)
class StaticInformation:
    """Information on S unknowns with the last k eliminated.

    Attributes:
        first: (n, n) on the first n (Schur complement).
        factor: (k, k) lower Cholesky factor L of the information on the last k alone.
        across: (k, n) L^-1 times the block between them.

    >>> found = StaticInformation.of(np.array([[3.0, 1.0], [1.0, 2.0]]), 1)
    >>> found.first
    array([[2.5]])
    >>> np.round(found.solution(np.array([5.0, 5.0])), 3)
    array([1., 2.])
    >>> root = found.root_of_covariance()
    >>> np.round(root @ root.T, 3)
    array([[ 0.4, -0.2],
           [-0.2,  0.6]])
    """

    first: np.ndarray
    factor: np.ndarray
    across: np.ndarray

    @classmethod
    def of(cls, information: np.ndarray, n: int) -> Self:
        """Eliminate all but the first n unknowns from the information (S, S).

        Raises:
            numpy.linalg.LinAlgError: the information on the others is not positive definite.
        """
        factor = cholesky(information[n:, n:], lower=True)
        across = solve_triangular(factor, information[n:, :n], lower=True)
        return cls(information[:n, :n] - across.T @ across, factor, across)

    @cached_property
    def _directions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information (n,) along n independent directions, the least that priors allow there, and the directions."""
        scale = 1.0 / np.sqrt(np.maximum(np.diag(self.first), LEAST_INFORMATION))
        values, vectors = np.linalg.eigh(scale[:, None] * self.first * scale)
        directions = scale[:, None] * vectors
        return values, LEAST_INFORMATION * np.square(directions).sum(axis=0), directions

    @property
    def is_rounded(self) -> bool:
        """Rounding took more information than there is in some direction, where precise data show almost nothing."""
        values, least, _ = self._directions
        return bool((values < _ROUNDED * least).any())

    @cached_property
    def _factored(self) -> tuple[np.ndarray, np.ndarray]:
        factors: tuple[np.ndarray, np.ndarray] = lu_factor(self.first)
        return factors

    def solution(self, rhs: np.ndarray) -> np.ndarray:
        """Solve the normal equations for a right-hand side (S,); returns all unknowns (S,)."""
        n = len(self.first)
        half = solve_triangular(self.factor, rhs[n:], lower=True)
        first = lu_solve(self._factored, rhs[:n] - self.across.T @ half)
        last = solve_triangular(self.factor, half - self.across @ first, lower=True, trans="T")
        return np.concatenate([first, last])

    def covariance_of(self, some: slice) -> np.ndarray:
        """Return the covariance (m, m) of some of the first n unknowns."""
        result: np.ndarray = lu_solve(self._factored, np.eye(len(self.first))[:, some])[some]
        return result

    def root_of_covariance(self) -> np.ndarray:
        """Return R (S, S) with covariance R R^T of all unknowns; in no direction is it larger than by priors alone."""
        return self._root

    @cached_property
    def _root(self) -> np.ndarray:
        n, k = len(self.first), len(self.factor)
        values, least, directions = self._directions
        result = np.zeros((n + k, n + k))
        result[:n, :n] = directions / np.sqrt(np.maximum(values, least))
        result[n:, n:] = np.eye(k)
        result[n:, :n] = -self.across @ result[:n, :n]
        result[n:] = solve_triangular(self.factor, result[n:], lower=True, trans="T")
        return result
