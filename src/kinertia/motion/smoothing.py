"""Fits quintic smoothing splines: smooth signals and derivatives from noisy samples (Woltring 1986).

Samples y_i at times t_i (any spacing; some may be missing) are replaced by the function s that minimises

    sum_i (y_i - s(t_i))^2  +  p * integral s'''(t)^2 dt

The minimiser is the natural quintic spline with knots at the samples: degree 5, four continuous derivatives,
third and fourth derivative zero at both ends, quadratic beyond them. A large p smooths more; p -> 0
interpolates, p -> infinity leaves the least-squares parabola.

*Cutoff.* With samples every dt seconds the sum is (1/dt) times an integral, and away from the ends a sinusoid
of angular frequency w comes out scaled by 1 / (1 + p dt w^6). Writing p = 1 / (dt (2 pi fc)^6) makes that

    gain(f) = 1 / (1 + (f / fc)^6)

a double (zero-phase) third-order Butterworth filter whose gain is 1/2 at fc: Woltring's convention, in which
the half-power frequency of the single pass names the double pass. On samples the law holds within 0.2 % of
(f/fc)^6 up to a quarter of the sampling rate.

*Generalised cross-validation (GCV)* chooses p per column without knowledge of the noise: it minimises

    GCV(p) = n RSS(p) / (n - trace A(p))^2,        A: the matrix that takes samples to fitted values.

It assumes noise that is independent from sample to sample; correlated noise is followed, not removed.

*Computation,* linear in the number of samples. With N_j the quadratic B-splines on the sample times,
D s = integral N_j s''' (third differences; bandwidth 4) and G their Gram matrix (bandwidth 5), the residual
e = y - s and a multiplier x solve, for m = 1/p and weights w_i (1, or 0 where the sample is missing),

    [ sqrt(m) W    D^T        ] [ e ]   [  0  ]
    [ D           -sqrt(m) G  ] [ x ] = [ D y ]

which, ordered along time, is banded with four diagonals on either side. Its condition number grows as sqrt(p)
where that of the usual normal equations grows as p, so a 1 Hz cutoff of data sampled at 2000 Hz loses few
digits. The trace is exact: differentiating the determinant of that matrix gives

    trace A = 3/2 + d log |det| / d log m

and the derivative comes with the factorisation itself, by taking m (1 + i 1e-30) for m (complex-step
derivative: the imaginary part carries the derivative without cancellation). This replaces the recurrence of
Hutchinson and de Hoog (1985), which yields the same number.

Sources: Woltring HJ (1986) A FORTRAN package for generalized, cross-validatory spline smoothing and
differentiation, Adv Eng Softw 8:104-113. Craven P, Wahba G (1979) Numer Math 31:377-403. Hutchinson MF, de
Hoog FR (1985) Numer Math 47:99-106. de Hoog FR, Hutchinson MF (1987) Numer Math 50:311-319.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import factorial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.linalg import lapack
from scipy.optimize import minimize_scalar

from kinertia.errors import KinertiaError
from kinertia.motion.workload import pieces

Array = NDArray[np.float64]

MIN_SAMPLES = 6
"""Fewest visible samples that a column can be smoothed from."""

_STEP = 1e-30  # of the complex-step derivative: its square vanishes beside 1
_BAND = 4  # diagonals on either side of the main one
_ROWS_AT_ONCE = 20000
_FORGOTTEN_PERIODS, _FORGOTTEN_SAMPLES = 13.0, 50
"""Periods of the cutoff, and additional samples, over which a sample loses all influence: exp(-pi) per period. The
influence in interpolating splines decays by 0.43 per sample."""


class SmoothingError(KinertiaError):
    """Raised if a column has too few visible samples to be smoothed.

    Attributes:
        column: the column's index.
        n_visible: number of its samples that are not NaN.
    """

    def __init__(self, column: int, n_visible: int) -> None:
        self.column = column
        self.n_visible = n_visible
        super().__init__(
            f"column {column} has {n_visible} visible samples, a smoothing spline needs {MIN_SAMPLES}: "
            "give a longer interval or leave this column out"
        )


@dataclass(frozen=True)
class SmoothedSpline:
    """Natural quintic smoothing splines of c columns; call it to evaluate them at any time.

    Attributes:
        time: (n,) s, the sample times, which are the knots.
        p: (c,) smoothing parameter of each column, s^5 (weight of the integral of the squared third
            derivative).
        cutoff_hz: (c,) Hz, frequency at which the equivalent filter's gain is 1/2.
        sigma: (c,) residual standard deviation in the column's unit: sqrt(RSS / (n_visible - trace A)), Woltring's
            estimate of the noise's standard deviation; NaN where the spline interpolates (cutoff too high).

    For values given as (n,) instead of (n, c) the three last are arrays of shape ().
    """

    time: Array
    p: Array
    cutoff_hz: Array
    sigma: Array
    _spline: BSpline = field(repr=False)
    _spacing: float = field(repr=False)

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Evaluate the splines, or one of their time derivatives.

        Beyond the first and last sample the natural spline continues as a parabola, which is valid for a few samples at
        most.

        Args:
            t: times in s, any shape.
            derivative: order of the derivative, 0 to 4.

        Returns:
            Array of shape `t.shape + (c,)` (`t.shape` for values given as (n,)), in unit / s^derivative.

        Raises:
            ValueError: the derivative is not 0 to 4.
        """
        if derivative not in range(5):
            raise ValueError(f"derivative must be 0 to 4, got {derivative}")
        scaled = (np.asarray(t, float) - self.time[0]) / self._spacing
        inside = np.clip(scaled, 0.0, (self.time[-1] - self.time[0]) / self._spacing)
        result = np.asarray(self._spline(inside, derivative), float)
        beyond = (scaled - inside).reshape(scaled.shape + (1,) * (result.ndim - scaled.ndim))
        if beyond.any():
            result = np.where((beyond != 0) & (derivative > 2), 0.0, result)
            for order in range(derivative + 1, 3):
                power = order - derivative
                result = result + self._spline(inside, order) * beyond**power / factorial(power)
        return result / self._spacing**derivative


def smooth(
    time: ArrayLike,
    values: ArrayLike,
    smoothing: float | Literal["gcv"],
    within_hz: tuple[float, float] | None = None,
) -> SmoothedSpline:
    """Fit natural quintic smoothing splines to sampled columns.

    Args:
        time: (n,) s, strictly increasing; need not be uniform.
        values: (n, c) or (n,), any unit. NaN is a missing sample: it has no weight, and the column is fitted
            to its visible samples alone.
        smoothing: cutoff frequency in Hz for all columns (see the module's text for the convention; with
            unequal or missing samples it refers to the mean spacing of `time`), or "gcv" to choose one for
            each column by generalised cross-validation.
        within_hz: lowest and highest cutoff that cross-validation may choose; if left out, a tenth of a cycle in the
            whole record and the sampling rate, which is no smoothing.

    Returns:
        The splines; `SmoothedSpline(t, derivative)` evaluates them.

    Raises:
        SmoothingError: a column has fewer than six visible samples.
        ValueError: shapes do not match, time does not increase, a value is infinite, or the cutoff is not
            positive.
    """
    time, columns, shape = _validated(time, values, smoothing)
    spacing = float((time[-1] - time[0]) / (len(time) - 1))
    system = _System.of((time - time[0]) / spacing)
    fitted = np.empty_like(columns)
    cutoff, sigma = np.empty(columns.shape[1]), np.empty(columns.shape[1])
    ends = np.clip((0.0, np.inf) if within_hz is None else np.multiply(within_hz, spacing), 0.1 / len(time), 1.0)
    for visible, group in equal_columns(~np.isnan(columns)):
        y = _filled(columns[:, group], visible)
        if smoothing == "gcv":
            chosen = _gcv_cutoffs(system, y, visible, ends)
        else:
            chosen = np.full(len(group), float(smoothing) * spacing)
        for f in np.unique(chosen):
            which = chosen == f
            fitted[:, group[which]], rss, trace = system.fit(y[:, which], visible, f)
            left_over = visible.sum() - trace
            sigma[group[which]] = np.sqrt(rss / left_over) if left_over > 0 else np.nan
        cutoff[group] = chosen / spacing
    spline = _natural((time - time[0]) / spacing, fitted)
    if not shape:
        spline = BSpline.construct_fast(spline.t, spline.c[:, 0], 5)
    p = (2 * np.pi * cutoff) ** -6.0 / spacing
    return SmoothedSpline(time, p.reshape(shape), cutoff.reshape(shape), sigma.reshape(shape), spline, spacing)


def interpolate(time: Array, values: Array) -> SmoothedSpline:
    """Interpolate all samples (n, ...) by natural quintic splines, as OpenSim's tools do with the columns of a file."""
    spacing = float((time[-1] - time[0]) / (len(time) - 1))
    shape = values.shape[1:]
    spline = _natural((time - time[0]) / spacing, values)
    return SmoothedSpline(time, np.zeros(shape), np.full(shape, np.inf), np.full(shape, np.nan), spline, spacing)


def _natural(time: Array, values: Array) -> BSpline:
    """Interpolate values (n, ...) by quintic splines that continue as parabolas at both ends; long records in parts."""
    n = len(time)
    if n <= 2 * _ROWS_AT_ONCE:
        ends = [(order, np.zeros(values.shape[1:])) for order in (3, 4)]
        return make_interp_spline(time, values, k=5, bc_type=(ends, ends))
    coefficients = np.empty((n + 4, *values.shape[1:]))
    for piece in pieces(n, _ROWS_AT_ONCE):
        near = slice(max(piece.start - _FORGOTTEN_SAMPLES, 0), min(piece.stop + _FORGOTTEN_SAMPLES, n))
        # the splines are two samples before those of the same index
        kept = slice(piece.start and piece.start + 2, piece.stop + (2 if piece.stop < n else 4))
        part = _natural(time[near], values[near]).c
        coefficients[kept] = part[kept.start - near.start : kept.stop - near.start]
    knots = np.concatenate([np.full(5, time[0]), time, np.full(5, time[-1])])
    return BSpline.construct_fast(knots, coefficients, 5)


def _validated(
    time: ArrayLike, values: ArrayLike, smoothing: float | Literal["gcv"]
) -> tuple[Array, Array, tuple[int, ...]]:
    """Return time (n,), values as (n, c), and the shape of one row of the values as given."""
    time, values = np.array(time, float), np.asarray(values, float)
    if time.ndim != 1 or values.ndim not in (1, 2) or len(values) != len(time):
        raise ValueError(f"time must be (n,) and values (n,) or (n, c), got {time.shape} and {values.shape}")
    if not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise ValueError("time must be finite and strictly increasing")
    if np.isinf(values).any():
        raise ValueError("values must be finite, or NaN where missing")
    if smoothing != "gcv" and not (isinstance(smoothing, int | float) and 0 < smoothing < np.inf):
        raise ValueError(f'smoothing must be "gcv" or a positive cutoff in Hz, got {smoothing!r}')
    columns = values.reshape(len(time), -1)
    for column, n_visible in enumerate((~np.isnan(columns)).sum(axis=0)):
        if n_visible < MIN_SAMPLES:
            raise SmoothingError(column, int(n_visible))
    return time, columns, values.shape[1:]


def equal_columns(visible: NDArray[np.bool_]) -> list[tuple[NDArray[np.bool_], NDArray[np.int_]]]:
    """Group equal columns of `visible` (n, c): return each different column, and the indices of columns equal to it."""
    groups: dict[bytes, list[int]] = {}
    for column, mask in enumerate(visible.T):
        groups.setdefault(mask.tobytes(), []).append(column)
    return [(visible[:, group[0]], np.array(group)) for group in groups.values()]


def _filled(columns: Array, visible: NDArray[np.bool_]) -> Array:
    """Fill missing samples with an interpolated number: it has no weight, but a near one keeps rounding small."""
    if visible.all():
        return columns
    index = np.arange(len(visible))
    return np.stack([np.interp(index, index[visible], y[visible]) for y in columns.T], axis=1)


def _gcv_cutoffs(system: _System, y: Array, visible: NDArray[np.bool_], ends: Array) -> Array:
    """Return the cutoff (c,), in cycles per mean spacing, that minimises GCV for each column of y (n, c) within limits.

    GCV is tabulated for all columns at once on the lattice f = 2^(k/8): first on half octaves, then on
    eighths around each column's least, where a cubic interpolant of its logarithm gives the minimum.
    """
    n_visible = int(visible.sum())
    rounding = n_visible * (np.finfo(float).eps * np.abs(y).max(axis=0)) ** 2 + np.finfo(float).tiny
    low, high = 8 * np.log2(ends)
    lattice = np.arange(-4 * int(np.ceil(-low / 4) + 1), 4 * int(np.ceil(high / 4)) + 1)
    table = np.full((len(lattice), y.shape[1]), np.nan)

    def tabulate(rows: NDArray[np.int_]) -> None:
        for row in rows[np.isnan(table[rows, 0])]:
            _, rss, trace = system.fit(y, visible, 2.0 ** (lattice[row] / 8))
            table[row] = np.log(rss + rounding) - 2 * np.log(n_visible - trace)

    coarse = np.arange(0, len(lattice), 4)
    tabulate(coarse)
    cutoffs = np.empty(y.shape[1])
    for column, least in enumerate(coarse[np.argmin(table[coarse], axis=0)]):
        near = np.arange(max(least - 4, 0), min(least + 5, len(lattice)))
        tabulate(near)
        curve = CubicSpline(lattice[near], table[near, column])
        tried = np.clip(lattice[near], low, high)
        best = tried[np.argmin(curve(tried))]
        bounds = np.clip((best - 1, best + 1), max(low, lattice[near[0]]), min(high, lattice[near[-1]]))
        polished = minimize_scalar(curve, bounds=bounds, method="bounded")
        cutoffs[column] = 2.0 ** ((polished.x if polished.fun < curve(best) else best) / 8)
    return cutoffs


@dataclass(frozen=True)
class _System:
    """Banded matrices of one time base, its mean spacing scaled to 1.

    Attributes:
        differences: (n - 3, 4), row j of D: integral of N_j s''' = sum_m differences[j, m] s(t_{j+m}).
        gram: (3, n - 3), diagonals of G: gram[a, j] = integral of N_j N_{j+a}.
        least: the shortest spacing.
    """

    differences: Array
    gram: Array
    least: float

    @classmethod
    def of(cls, t: Array) -> _System:
        """Build the matrices part by part: row j of either depends on t[j] to t[j + 5] only."""
        parts = [_matrices(t[rows.start : rows.stop + 5].tobytes()) for rows in pieces(len(t) - 3, _ROWS_AT_ONCE)]
        rows = [slice(0, _ROWS_AT_ONCE)] * (len(parts) - 1) + [slice(None)]
        differences = [difference[kept] for (difference, _), kept in zip(parts, rows, strict=True)]
        gram = [part_gram[:, kept] for (_, part_gram), kept in zip(parts, rows, strict=True)]
        return cls(np.concatenate(differences), np.concatenate(gram, axis=1), float(np.diff(t).min()))

    def fit(self, y: Array, visible: NDArray[np.bool_], f: float) -> tuple[Array, Array, float]:
        """Return fitted values (n, c), residual sums of squares (c,), trace A for a cutoff of f cycles per spacing.

        Long records without gaps are fitted in parts with sufficient overlap; the trace of samples that two parts share
        is that of these samples by themselves, ends included.
        """
        n, around = len(y), int(np.ceil(_FORGOTTEN_PERIODS / (f * self.least))) + _FORGOTTEN_SAMPLES
        most = max(_ROWS_AT_ONCE, 2 * around)
        if n <= 2 * most or not visible.all():
            return self._fit(y, visible, f)
        fitted, rss, trace = np.empty_like(y), np.zeros(y.shape[1]), 0.0
        for piece in pieces(n, most):
            near = slice(max(piece.start - around, 0), min(piece.stop + around, n))
            part, _, of_part = self._cut(near)._fit(y[near], visible[near], f)
            fitted[piece] = part[piece.start - near.start : piece.stop - near.start]
            rss += np.square(y[piece] - fitted[piece]).sum(axis=0)
            trace += of_part
            if piece.start:
                shared = slice(near.start, min(piece.start + around, n))
                trace -= self._cut(shared)._fit(y[shared, :1], visible[shared], f)[2]
        return fitted, rss, trace

    def _cut(self, samples: slice) -> _System:
        """Return the matrices of these samples."""
        rows = slice(samples.start, samples.stop - 3)
        return _System(self.differences[rows], self.gram[:, rows], self.least)

    def _fit(self, y: Array, visible: NDArray[np.bool_], f: float) -> tuple[Array, Array, float]:
        """Fit all samples at once, as `fit` does.

        The unknown e_i is at index 2 i, x_j at index 2 j + 3, between the e that it couples; the second and the second
        last index are empty.
        """
        n = len(y)
        places = 2 * np.arange(n - 3) + 3
        matrix = self._matrix((2 * np.pi * f) ** 3 * (1 + 0.5j * _STEP), visible, places)
        factors, pivots, _ = lapack.zgbtrf(matrix, _BAND, _BAND, overwrite_ab=1)
        diagonal = factors[2 * _BAND]
        trace = 1.5 + float((diagonal.imag / diagonal.real).sum()) / _STEP
        real = factors.real.copy(order="F")
        del matrix, factors, diagonal  # for long records with gaps they take some hundred MB
        rhs = np.zeros((2 * n - 1, y.shape[1]), order="F")
        for m in range(4):
            rhs[places] += self.differences[:, m, None] * y[m : n - 3 + m]
        solution, _ = lapack.dgbtrs(real, _BAND, _BAND, rhs, pivots, overwrite_b=1)
        residual = solution[::2]
        return y - residual, np.einsum("nc,nc,n->c", residual, residual, visible.astype(float)), trace

    def _matrix(self, root: complex, visible: NDArray[np.bool_], places: NDArray[np.int_]) -> NDArray[np.complex128]:
        """Build LAPACK band storage, element (r, c) at [2 _BAND + r - c, c], of the matrix for sqrt(m) = root."""
        n = len(visible)
        main = 2 * _BAND
        matrix = np.zeros((3 * _BAND + 1, 2 * n - 1), complex, order="F")
        matrix[main, ::2] = root * visible
        matrix[main, [1, -2]] = 1.0
        for m in range(4):
            offset = 2 * m - 3
            matrix[main + offset, places] = self.differences[:, m]
            matrix[main - offset, places + offset] = self.differences[:, m]
        for a in range(3):
            size = n - 3 - a
            matrix[main - 2 * a, places[:size] + 2 * a] = -root * self.gram[a, :size]
            matrix[main + 2 * a, places[:size]] = -root * self.gram[a, :size]
        return matrix


@lru_cache(maxsize=4)
def _matrices(times: bytes) -> tuple[Array, Array]:
    """Compute `differences` and `gram` of `_System` for sample times (n,); cached, since all quantities need them."""
    t = np.frombuffer(times)
    n = len(t)
    knots = np.stack([t[m : n - 3 + m] for m in range(4)], axis=1)
    factors = knots[:, :, None] - knots[:, None, :] + np.eye(4)
    differences = 2 * (knots[:, 3] - knots[:, 0])[:, None] / factors.prod(axis=2)
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact to degree 5; the integrand has degree 4
    x = t[:-1, None] + np.diff(t)[:, None] * (nodes + 1) / 2
    weight = np.diff(t)[:, None] * weights / 2
    padded = np.concatenate([t[0] - [2, 1], t, t[-1] + [1, 2]])
    # basis[i, g, k] is N_{i-2+k} at Gauss point g of interval i
    basis = BSpline.design_matrix(x.ravel(), padded, 2).data.reshape(n - 1, 3, 3)
    gram = np.zeros((3, n - 3))
    for a in range(3):
        size = n - 3 - a
        for k in range(a, 3):
            piece = slice(k, k + size)
            product = basis[piece, :, 2 - k] * basis[piece, :, 2 - k + a]
            gram[a, :size] += (weight[piece] * product).sum(axis=1)
    return differences, gram
