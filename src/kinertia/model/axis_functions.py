"""Evaluates the functions by which a joint axis depends on a coordinate, with three derivatives.

OpenSim's functions of one variable are piecewise polynomials, so one class holds them all; a coupled coordinate is a
function of a function.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

HIGHEST_DERIVATIVE = 3


class AxisFunction(Protocol):
    """A function of one coordinate."""

    def __call__(self, q: np.ndarray, order: int = 0) -> np.ndarray:
        """Return values of the derivative of this order (0 to 3) at q (n,)."""


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    """Polynomials between `knots` (k,); the first and the last one continue beyond the ends.

    Attributes:
        knots: increasing.
        coefficients: (degree + 1, k - 1), highest power first, of the distance from the knot on the left.
    """

    knots: np.ndarray
    coefficients: np.ndarray

    @cached_property
    def _derivatives(self) -> tuple[PPoly, ...]:
        whole = PPoly(self.coefficients, self.knots)
        return tuple(whole.derivative(order) if order else whole for order in range(HIGHEST_DERIVATIVE + 1))

    def __call__(self, q: np.ndarray, order: int = 0) -> np.ndarray:
        """Return values of the derivative of this order at q (n,)."""
        result: np.ndarray = self._derivatives[order](q)
        return result

    def scaled(self, factor: float) -> "PiecewisePolynomial":
        """Return this function times a factor."""
        return PiecewisePolynomial(self.knots, self.coefficients * factor)


@dataclass(frozen=True, eq=False)
class Composed:
    """The composition outer(inner(q))."""

    outer: AxisFunction
    inner: AxisFunction

    def __call__(self, q: np.ndarray, order: int = 0) -> np.ndarray:
        """Return values of the derivative of this order at q (n,), by the chain rule."""
        at = self.inner(q)
        f = [self.outer(at, k) for k in range(order + 1)]
        g = [self.inner(q, k) for k in range(order + 1)]
        if order == 0:
            return f[0]
        result: np.ndarray
        if order == 1:
            result = f[1] * g[1]
        elif order == 2:
            result = f[2] * g[1] ** 2 + f[1] * g[2]
        else:
            result = f[3] * g[1] ** 3 + 3.0 * f[2] * g[1] * g[2] + f[1] * g[3]
        return result


def polynomial(coefficients: ArrayLike) -> PiecewisePolynomial:
    """Make a polynomial from coefficients, highest power first, as in OpenSim's PolynomialFunction."""
    return PiecewisePolynomial(np.array([0.0, 1.0]), np.array(coefficients, dtype=float)[:, None])


def constant(value: float) -> PiecewisePolynomial:
    """Make a constant function."""
    return polynomial([value])


def linear(slope: float, intercept: float = 0.0) -> PiecewisePolynomial:
    """Make the function slope q + intercept."""
    return polynomial([slope, intercept])


def piecewise_linear(x: ArrayLike, y: ArrayLike) -> PiecewisePolynomial:
    """Connect points by straight lines, the outer ones extended, as in OpenSim's PiecewiseLinearFunction.

    Raises:
        ValueError: fewer than two points, or x does not grow.
    """
    knots, values = _points(x, y, 2)
    return PiecewisePolynomial(knots, np.stack([np.diff(values) / np.diff(knots), values[:-1]]))


def simm_spline(x: ArrayLike, y: ArrayLike) -> PiecewisePolynomial:
    """Make OpenSim's SimmSpline: a cubic spline that continues as a straight line beyond its ends.

    Its third derivative at either end is that of the cubic through the four outer points (Forsythe, Malcolm and Moler
    1977), not the natural spline's zero curvature; with three points it is one parabola, with two a line.

    Raises:
        ValueError: fewer than two points, or x does not grow.
    """
    knots, values = _points(x, y, 2)
    if len(knots) == 2:
        return piecewise_linear(x, y)
    gap = np.diff(knots)
    slope = np.diff(values) / gap
    curve = _sixths_of_curvature(knots, gap, slope)
    first = slope - gap * (curve[1:] + 2.0 * curve[:-1])
    inner = np.stack([np.diff(curve) / gap, 3.0 * curve[:-1], first, values[:-1]])
    end_slope = slope[-1] + gap[-1] * (curve[-2] + 2.0 * curve[-1])
    before = [0.0, 0.0, first[0], values[0] - first[0]]
    after = [0.0, 0.0, end_slope, values[-1]]
    extended = np.concatenate([[knots[0] - 1.0], knots, [knots[-1] + 1.0]])
    return PiecewisePolynomial(extended, np.column_stack([before, inner, after]))


def _sixths_of_curvature(knots: np.ndarray, gap: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Solve the spline's tridiagonal system for second derivatives at the knots over six (k,)."""
    count = len(knots)
    matrix = np.zeros((count, count))
    rhs = np.zeros(count)
    inner = np.arange(1, count - 1)
    matrix[inner, inner - 1], matrix[inner, inner + 1] = gap[:-1], gap[1:]
    matrix[inner, inner] = 2.0 * (gap[:-1] + gap[1:])
    rhs[1:-1] = np.diff(slope)
    matrix[0, :2], matrix[-1, -2:] = [-gap[0], gap[0]], [gap[-1], -gap[-1]]
    if count > 3:
        second = np.diff(slope) / (knots[2:] - knots[:-2])
        rhs[0] = gap[0] ** 2 * (second[1] - second[0]) / (knots[3] - knots[0])
        rhs[-1] = -(gap[-1] ** 2) * (second[-1] - second[-2]) / (knots[-1] - knots[-4])
    return np.linalg.solve(matrix, rhs)


def _points(x: ArrayLike, y: ArrayLike, fewest: int) -> tuple[np.ndarray, np.ndarray]:
    knots, values = np.array(x, dtype=float), np.array(y, dtype=float)
    if len(knots) != len(values) or len(knots) < fewest:
        raise ValueError(f"{len(knots)} x and {len(values)} y; expected as many, at least {fewest}")
    if not (np.diff(knots) > 0).all():
        raise ValueError("x must increase from point to point")
    return knots, values


def unit_slope(function: AxisFunction) -> float | None:
    """Return 1 or -1 if the function is q or -q; None if it is anything else."""
    if not isinstance(function, PiecewisePolynomial) or function.coefficients.shape[1] != 1:
        return None
    rest, slope, intercept = function.coefficients[:-2], function.coefficients[-2:-1], function.coefficients[-1]
    if slope.size == 0 or rest.any() or intercept.any() or abs(slope[0, 0]) != 1.0:
        return None
    return float(slope[0, 0])


def constant_value(function: AxisFunction) -> float | None:
    """Return the value if the function is constant; None if it is not."""
    if not isinstance(function, PiecewisePolynomial) or function.coefficients[:-1].any():
        return None
    values = np.unique(function.coefficients[-1])
    return float(values[0]) if len(values) == 1 else None
