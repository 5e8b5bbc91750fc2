"""Holds a point of the estimate, and the linearised cost there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.elimination import Eliminated
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior


@dataclass(frozen=True)
class Point:
    """Values of all unknowns.

    Attributes:
        coefficients: per trial those of its motion.
        static: (S,) what does not move.
        displaced: per trial (3 m,) displacements of its markers (`displacement`), in prior deviations.
    """

    coefficients: tuple[np.ndarray, ...]
    static: np.ndarray
    displaced: tuple[np.ndarray, ...]

    @property
    def vector(self) -> np.ndarray:
        """All of them, one after the other."""
        return np.concatenate([*(each.ravel() for each in self.coefficients), self.static, *self.displaced])

    def like(self, vector: np.ndarray) -> Point:
        """The point of which this is the `vector`."""
        ends = np.cumsum([each.size for each in (*self.coefficients, self.static, *self.displaced)])
        parts = np.split(vector, ends[:-1])
        motions = zip(parts, self.coefficients, strict=False)
        count = len(self.coefficients)
        return Point(tuple(p.reshape(c.shape) for p, c in motions), parts[count], tuple(parts[count + 1 :]))


@dataclass(frozen=True)
class Slope:
    """Half the sum of squares at a point, and where it falls.

    The priors of the instruments are none of a Gaussian: they count only after `under`.

    Attributes:
        point: the point.
        cost: half the sum of squares of everything.
        right: minus its derivatives by all unknowns, as `Point.vector` has them.
        instruments: of which unknowns of the vector.
    """

    point: Point
    cost: float
    right: np.ndarray
    instruments: slice

    def under(self, prior: GaussianPrior) -> tuple[float, np.ndarray]:
        """Cost and right-hand side with this Gaussian for the instruments."""
        values, right = self.point.vector[self.instruments], self.right.copy()
        right[self.instruments] += prior.pull - prior.precision @ values
        return self.cost + prior.cost(values), right


@dataclass(frozen=True)
class Linearised:
    """Normal equations at a point, motions eliminated.

    Attributes:
        slope: there.
        trials: of each trial, on the static unknowns as they are in it.
        information: (S, S) of the priors but the instruments'.
    """

    slope: Slope
    trials: tuple[Eliminated, ...]
    information: np.ndarray

    @property
    def point(self) -> Point:
        """Where it is."""
        return self.slope.point
