"""Holds a point of the estimate, and the cost linearised there."""

from dataclasses import dataclass

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.elimination import Eliminated
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior


@dataclass(frozen=True)
class Point:
    """Values of all unknowns.

    Attributes:
        coefficients: per trial the spline coefficients of its motion.
        static: (S,) unknowns that do not move.
        displaced: per trial (3 m,) displacements of its markers (`displacement`), in prior standard deviations.
    """

    coefficients: tuple[np.ndarray, ...]
    static: np.ndarray
    displaced: tuple[np.ndarray, ...]

    @property
    def vector(self) -> np.ndarray:
        """All unknowns in one vector."""
        return np.concatenate([*(each.ravel() for each in self.coefficients), self.static, *self.displaced])

    def like(self, vector: np.ndarray) -> "Point":
        """Return the point whose `vector` this is."""
        ends = np.cumsum([each.size for each in (*self.coefficients, self.static, *self.displaced)])
        parts = np.split(vector, ends[:-1])
        motions = zip(parts, self.coefficients, strict=False)
        count = len(self.coefficients)
        return Point(tuple(p.reshape(c.shape) for p, c in motions), parts[count], tuple(parts[count + 1 :]))


@dataclass(frozen=True)
class Slope:
    """Half the sum of squares at a point, and minus its gradient.

    The instruments' priors are not Gaussian: they are included only by `under`.

    Attributes:
        point: the point.
        cost: half the sum of squares of everything.
        rhs: minus its derivatives by all unknowns, as `Point.vector` has them.
        instruments: slice of the instruments' unknowns in the vector.
    """

    point: Point
    cost: float
    rhs: np.ndarray
    instruments: slice

    def under(self, prior: GaussianPrior) -> tuple[float, np.ndarray]:
        """Return cost and right-hand side with this Gaussian for the instruments."""
        values, rhs = self.point.vector[self.instruments], self.rhs.copy()
        rhs[self.instruments] += prior.pull - prior.precision @ values
        return self.cost + prior.cost(values), rhs


@dataclass(frozen=True)
class Linearised:
    """Normal equations at a point, with the motions eliminated.

    Attributes:
        slope: cost and gradient there.
        trials: each trial's equations, for the static unknowns as they are in it.
        information: (S, S) of all priors but the instruments'.
    """

    slope: Slope
    trials: tuple[Eliminated, ...]
    information: np.ndarray

    @property
    def point(self) -> Point:
        """The point of linearisation."""
        return self.slope.point
