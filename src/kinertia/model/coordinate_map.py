"""Maps coordinates to the axes of the kinematic tree and back.

An axis x depends on one coordinate q by a function: x = f(q), xd = f' qd, xdd = f' qdd + f'' qd^2. Several axes may
depend on the same coordinate (a knee that rolls and slides, a patella coupled to it). By virtual work the generalised
force of a coordinate is the sum over its axes of f' times the axis' force. If every axis is its own coordinate nothing
is computed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from kinertia.model.axis_functions import AxisFunction


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

    def bends(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
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
        slope, of_rate, of_acceleration = np.moveaxis(self.bends(q, qd, qdd)[:, None], -1, 0)
        by_q = at * slope + rate * of_rate + acceleration * of_acceleration
        by_qd = rate * slope + acceleration * (2.0 * of_rate)
        return by_q @ self._sum, by_qd @ self._sum, (acceleration * slope) @ self._sum
