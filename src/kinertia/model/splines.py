"""Curves through samples: B-splines (de Boor 1978, A Practical Guide to Splines, ch. IX-XIII) and monotone cubics.

SciPy has all of it. But its splines come with its optimisers, special functions and transforms, and to load those takes
as long as the estimate of a short walk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack


@dataclass(frozen=True, eq=False)
class BSpline:
    """Piecewise polynomials of one degree: sum over j of c[j] N_j(x).

    Beyond the first and last knot between which all of x is spanned, the polynomials next to them go on.

    Attributes:
        t: (n + k + 1,) knots, not falling.
        c: (n, ...) coefficients.
        k: degree.
    """

    t: np.ndarray
    c: np.ndarray
    k: int

    def __call__(self, x: ArrayLike, derivative: int = 0) -> np.ndarray:
        """Values (x.shape + the shape of a coefficient) at x, or of a derivative there."""
        x = np.asarray(x, float)
        if derivative > 0:
            return self.derivative()(x, derivative - 1)
        first, values = basis(self.t, self.k, x.ravel())
        flat = self.c.reshape(len(self.c), -1)
        result = np.zeros((x.size, flat.shape[1]))
        for j, value in enumerate(values):
            result += value[:, None] * flat[first + j]
        return result.reshape(x.shape + self.c.shape[1:])

    def derivative(self) -> BSpline:
        """The spline of the slopes, one degree lower."""
        if self.k == 0:
            return BSpline(self.t, np.zeros_like(self.c), 0)
        width = self.t[self.k + 1 : -1] - self.t[1 : -self.k - 1]
        each = (self.k / width).reshape(-1, *(1,) * (self.c.ndim - 1))
        return BSpline(self.t[1:-1], np.diff(self.c, axis=0) * each, self.k - 1)


def basis(t: np.ndarray, k: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first of the splines of degree k on knots t that are active at each x (m,), and the values of all k + 1 that
    are (k + 1, m), by the recurrence of Cox and de Boor.
    """
    interval = np.clip(np.searchsorted(t, x, side="right") - 1, k, len(t) - k - 2)
    near = t[interval + np.arange(1 - k, k + 1)[:, None]]
    beyond, values = x - near, np.empty((k + 1, len(x)))
    values[0] = 1.0
    for degree in range(1, k + 1):
        carried = np.zeros(len(x))
        for j in range(degree):
            left, right = k - degree + j, k + j
            part = values[j] / (near[right] - near[left])
            values[j] = carried - beyond[right] * part
            carried = beyond[left] * part
        values[degree] = carried
    return interval - k, values


def natural(x: np.ndarray, y: np.ndarray, k: int) -> BSpline:
    """Through the samples y (n, ...) at x (n,), of odd degree k: as polynomials of half the degree at either end, where
    the derivatives from (k + 1) / 2 to k - 1 vanish.
    """
    t = np.concatenate([np.full(k, x[0]), x, np.full(k, x[-1])])
    return _through(x, y, k, t, range((k + 1) // 2, k))


def not_a_knot(x: np.ndarray, y: np.ndarray, k: int) -> BSpline:
    """Through the samples y (n, ...) at x (n,), of odd degree k < n: without knots at the samples next to the ends."""
    half = (k + 1) // 2
    t = np.concatenate([np.full(k + 1, x[0]), x[half:-half], np.full(k + 1, x[-1])])
    return _through(x, y, k, t, ())


def _through(x: np.ndarray, y: np.ndarray, k: int, t: np.ndarray, vanishing: range | tuple[()]) -> BSpline:
    """The spline on knots t through all samples, with these derivatives zero at both ends: a system of k diagonals on
    either side.
    """
    first, values = basis(t, k, x)
    ends, n = len(vanishing), len(t) - k - 1
    # LAPACK's band storage: element (i, j) at [2 k + i - j, j]
    matrix, right = np.zeros((3 * k + 1, n)), np.zeros((n, y[0].size))
    columns, rows = first + np.arange(k + 1)[:, None], ends + np.arange(len(x))
    matrix[2 * k + rows - columns, columns] = values
    right[rows] = y.reshape(len(y), -1)
    own = np.arange(k + 1)
    for row, column, at in ((0, 0, 0), (n - ends, n - k - 1, -1)):
        slopes = BSpline(t[column : column + 2 * k + 2], np.eye(k + 1), k)
        for order in range(1, k if ends else 1):
            slopes = slopes.derivative()
            if order in vanishing:
                # a spline's first and last coefficient are its values at the ends
                i = row + vanishing.index(order)
                matrix[2 * k + i - column - own, column + own] = slopes.c[at]
    _, _, c, _ = lapack.dgbsv(k, k, matrix, right)
    return BSpline(t, c.reshape(n, *y.shape[1:]), k)


def monotone(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubics through the samples y (n, c) at x (n,), n > 1, that overshoot nowhere, at other places: their slope at a
    sample is a harmonic mean of those on both sides, or zero where these differ in sign (Fritsch and Butland 1984,
    SIAM J Sci Stat Comput 5:300).
    """
    if len(x) == 2:
        return not_a_knot(x, y, 1)(at)
    step = np.diff(x)[:, None]
    rise = np.diff(y, axis=0) / step
    before, after = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    alike = rise[:-1] * rise[1:] > 0.0
    both = np.where(alike, before * rise[1:] + after * rise[:-1], 1.0)
    mean = np.where(alike, (before + after) * rise[:-1] * rise[1:] / both, 0.0)
    first, last = _end_slope(step[:2], rise[:2]), _end_slope(step[:-3:-1], rise[:-3:-1])
    slope = np.concatenate([first[None], mean, last[None]])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    s = (at - x[i])[:, None] / step[i]
    result: np.ndarray = (
        y[i] * (1 + 2 * s) * (1 - s) ** 2
        + y[i + 1] * (3 - 2 * s) * s**2
        + step[i] * (slope[i] * s * (1 - s) ** 2 - slope[i + 1] * s**2 * (1 - s))
    )
    return result


def _end_slope(step: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """(c,) of the parabola through the last three samples, as far as it does not overshoot; from their steps (2, 1) and
    slopes (2, c), inwards.
    """
    parabola = ((2 * step[0] + step[1]) * rise[0] - step[0] * rise[1]) / (step[0] + step[1])
    steep = (rise[0] * rise[1] < 0.0) & (np.abs(parabola) > 3 * np.abs(rise[0]))
    return np.where(parabola * rise[0] <= 0.0, 0.0, np.where(steep, 3 * rise[0], parabola))
