"""Maps coordinates to the axes of the kinematic tree and back, by functions with three derivatives.

An axis x depends on one coordinate q by a function: x = f(q), xd = f' qd, xdd = f' qdd + f'' qd^2. Several axes may
depend on the same coordinate (a knee that rolls and slides, a patella coupled to it). By virtual work the generalised
force of a coordinate is the sum over its axes of f' times the axis' force. If every axis is its own coordinate nothing
is computed.

It has three translations, then three rotations about body-fixed perpendicular axes: tilt (z), list (x), rotation (y) in
the 27-DOF model, any such triple in an OpenSim model. "Residual" always means force (N) in ground axes and moment (N m)
about the centre of these rotations (the pelvis origin, unless the model defines another point), in ground axes.

OpenSim's functions of one variable are piecewise polynomials, so one class holds them all; a coupled coordinate is a
function of a function.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly
from scipy.spatial.transform import Rotation

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


@dataclass(frozen=True, eq=False)
class CoordinateMap:
    """Functions from coordinates to all moving axes.

    Attributes:
        owner: (a,) index of each axis' coordinate.
        functions: of each axis; None where the axis is its coordinate.
        count: number of coordinates, c.
    """

    owner: np.ndarray
    functions: tuple[AxisFunction | None, ...]
    count: int

    @classmethod
    def of(cls, coordinates: Sequence[str], followed: Sequence[str], functions: Sequence[AxisFunction | None]) -> Self:
        """Make the map of axes that depend on these coordinates (one name per axis) by these functions."""
        index = {name: i for i, name in enumerate(coordinates)}
        return cls(np.array([index[name] for name in followed], dtype=int), tuple(functions), len(coordinates))

    @cached_property
    def identity(self) -> bool:
        """Whether every axis is its own coordinate."""
        return all(f is None for f in self.functions) and np.array_equal(self.owner, np.arange(self.count))

    @cached_property
    def _sum(self) -> np.ndarray:
        """Matrix (a, c) that sums the axes of every coordinate."""
        result: np.ndarray = (self.owner[:, None] == np.arange(self.count)).astype(float)
        return result

    def _evaluated(self, q: np.ndarray, order: int) -> np.ndarray:
        """Return the derivative (n, a) of this order of every axis by its coordinate."""
        result = q[:, self.owner] if order == 0 else np.full((len(q), len(self.owner)), float(order == 1))
        for axis, function in enumerate(self.functions):
            if function is not None:
                result[:, axis] = function(q[:, self.owner[axis]], order)
        return result

    def axes(self, q: np.ndarray) -> np.ndarray:
        """Return the values (n, a) of the axes at the coordinates q (n, c)."""
        return q if self.identity else self._evaluated(q, 0)

    def slopes(self, q: np.ndarray) -> np.ndarray | None:
        """Return the derivative (n, a) of every axis by its coordinate; None if every axis is its coordinate."""
        return None if self.identity else self._evaluated(q, 1)

    def places_and_slopes(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `axes` and `slopes` for compiled functions: each (n, a), contiguous, with ones for slopes of None."""
        at, slopes = np.ascontiguousarray(self.axes(q)), self.slopes(q)
        return at, np.ones_like(at) if slopes is None else np.ascontiguousarray(slopes)

    def motion(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return values, rates and accelerations of the axes, each (n, a)."""
        if self.identity:
            return q, qd, qdd
        first, second = self._evaluated(q, 1), self._evaluated(q, 2)
        rate = qd[:, self.owner]
        return self._evaluated(q, 0), first * rate, first * qdd[:, self.owner] + second * rate**2

    def chain(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Return the dependence (n, a, 3) of every axis on its coordinate, for compiled functions.

        It holds the axis' slope, and the derivatives of the axis' rate and acceleration by the coordinate; its shape is
        (0, a, 3) if every axis is its own coordinate.
        """
        if self.identity:
            return np.empty((0, self.count, 3))
        first, second, third = (self._evaluated(q, order) for order in (1, 2, 3))
        v, a = qd[:, self.owner], qdd[:, self.owner]
        return np.stack([first, second * v, second * a + third * v**2], axis=-1)

    def to_coordinates(self, columns: np.ndarray, slopes: np.ndarray | None) -> np.ndarray:
        """Convert (n, ..., a) to (n, ..., c): forces, or derivatives by axes, to those by coordinates.

        Args:
            columns: one column per axis.
            slopes: (n, a), from `slopes`.
        """
        if slopes is None:
            return columns
        result: np.ndarray = (
            columns * slopes.reshape(len(slopes), *(1,) * (columns.ndim - 2), slopes.shape[1])
        ) @ self._sum
        return result

    def turned_forces(self, forces: np.ndarray, q: np.ndarray) -> np.ndarray | float:
        """Return the derivative (n, c) of the generalised forces by their own coordinates due to the map alone.

        Forces (n, a) of the axes are constant; it is 0 if every axis is its own coordinate.
        """
        return 0.0 if self.identity else (forces * self._evaluated(q, 2)) @ self._sum

    def derivatives_to_coordinates(
        self,
        by_axes: tuple[np.ndarray, np.ndarray, np.ndarray],
        q: np.ndarray,
        qd: np.ndarray,
        qdd: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Convert derivatives (n, r, a) by axis values, rates and accelerations to (n, r, c) by q, qd and qdd."""
        if self.identity:
            return by_axes
        at, rate, acceleration = by_axes
        slope, of_rate, of_acceleration = np.moveaxis(self.chain(q, qd, qdd)[:, None], -1, 0)
        by_q = at * slope + rate * of_rate + acceleration * of_acceleration
        by_qd = rate * slope + acceleration * (2.0 * of_rate)
        return by_q @ self._sum, by_qd @ self._sum, (acceleration * slope) @ self._sum


@dataclass(frozen=True, eq=False)
class Root:
    """Position and axes of the free joint.

    Attributes:
        rotation, translation: (3, 3) and (3,) m, the joint's frame in ground.
        slides: (3, 3) columns are the directions of the three translations, in the joint's frame.
        turns: (3, 3) columns are the axes of the three rotations at zero, in the joint's frame.
        child_rotation, child_translation: the joint's far frame in the root segment's frame.
    """

    rotation: np.ndarray
    translation: np.ndarray
    slides: np.ndarray
    turns: np.ndarray
    child_rotation: np.ndarray
    child_translation: np.ndarray

    def centre(self, q: np.ndarray) -> np.ndarray:
        """Return the centre (n, 3) m of the rotations in ground, at the root coordinates q (n, 6 or more)."""
        result: np.ndarray = self.translation + q[:, :3] @ self._slides.T
        return result

    @property
    def moves(self) -> np.ndarray:
        """Directions (3, 3), in rows and in ground, in which the first three coordinates move the centre."""
        return np.ascontiguousarray(self._slides.T)

    @property
    def _slides(self) -> np.ndarray:
        result: np.ndarray = self.rotation @ self.slides
        return result

    def axes(self, q: np.ndarray) -> np.ndarray:
        """Return the axes (n, 3, 3) of the three rotations in ground, in columns; omega = A * angle rates."""
        first, second, third = (self.rotation @ self.turns).T
        c1, s1, c2, s2 = np.cos(q[:, 3, None]), np.sin(q[:, 3, None]), np.cos(q[:, 4, None]), np.sin(q[:, 4, None])
        about_2 = c1 * second + s1 * np.cross(first, second)
        # the third axis, rotated by the second angle, then by the first
        along = float(np.cross(second, third) @ first)
        about_3 = c2 * (c1 * third + s1 * np.cross(first, third)) + s2 * along * first
        return np.stack([np.broadcast_to(first, about_2.shape), about_2, about_3], axis=-1)

    def about_centre(self, q: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Convert a load (n, 6: force, moment about the ground origin) to moments about the centre."""
        force, moment = load[:, :3], load[:, 3:]
        return np.concatenate([force, moment - np.cross(self.centre(q), force)], axis=1)

    def centre_moves(self, load: np.ndarray) -> np.ndarray:
        """Return d x force (n, 3, 3) of a load (n, 6), a column for each direction d of the centre's translation."""
        return np.stack([np.cross(direction, load[:, :3]) for direction in self._slides.T], axis=-1)

    def coordinates(self, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
        """Return root coordinates (n, 6) for these rotations (n, 3, 3) and translations (n, 3) of the root segment."""
        centre = translation + rotation @ self.child_translation
        turned = self.rotation.T @ rotation @ self.child_rotation
        with warnings.catch_warnings(action="ignore"):  # at gimbal lock one of the possible triples will do
            angles = Rotation.from_matrix(turned).as_davenport(self.turns.T, "intrinsic")
        slides = np.linalg.solve(self._slides, (centre - self.translation).T).T
        return np.hstack([slides, angles])
