"""Restrains the motion: coordinates within their ranges, and near the start where no data determine it.

Where markers hardly determine a coordinate, the rotation of a forearm above all, the estimate would take it through
impossible poses, in long steps that do not end. The penalty is one-sided: the square of the excess, over a standard
deviation, once per knot interval. The standard deviation comes from anatomy (`range_of_motion`); where the model clamps
a range it is so small that the coordinate stays at the limit.

Limits are rounded off over a third of a degree: an excess x counts as s log(1 + exp(x / s)). At a sharp limit the
curvature of the cost would jump, and with it the standard deviations of everything near a range limit; a search that
meets such limits oscillates between them.

The outermost splines hardly affect the data, and markers may be missing for a while. A spline coefficient that nothing
else determines follows its neighbours: its change from the start may vary from one coefficient to the next by
CHANGE_SD. The change itself is nearly free, AWAY_SD. Otherwise each of the thousands of coefficients of a long trial
would fix a constant offset of a joint angle, which misplaced markers have put into the start, and count it as known.
"""

from typing import NamedTuple, Self

import numpy as np
from scipy.special import expit

from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import Gradient, NormalEquations
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, InTrial
from kinertia.model.coordinate_range import Bounds

_ROUNDED = 0.005
"""Angle or length (rad or m) over which a limit is rounded off, s above."""
_NOTHING = 8.0
"""Distance within the range, in units of the rounding, beyond which the penalty is zero: it would be a millionth."""
CHANGE_SD, AWAY_SD = 1.0, 30.0
"""Standard deviations (rad or m): of the difference from one coefficient to the next, and of each by itself."""


class RangeTerms(NamedTuple):
    """Penalty of coordinates (n, c) beyond their ranges.

    Attributes:
        curvature: (n, c) second derivatives of the cost; zero well within the range.
        pull: (n, c) back into the range: minus the first derivatives.
        cost: half the sum of squares.
    """

    curvature: np.ndarray
    pull: np.ndarray
    cost: float

    @classmethod
    def of(cls, bounds: Bounds, q: np.ndarray, frames_per_interval: float) -> Self:
        """Compute the penalty of coordinates q (n, c), rad and m.

        >>> import numpy as np
        >>> from kinertia.model.coordinate_range import Range
        >>> bounds = Bounds.of(("elbow",), {"elbow": Range(0.0, 2.6, clamped=True)})
        >>> terms = RangeTerms.of(bounds, np.array([[1.0], [2.65]]), frames_per_interval=1.0)
        >>> terms.curvature.ravel().round(), terms.pull.ravel().round(), round(terms.cost, 2)
        (array([    0., 10000.]), array([  -0., -500.]), 12.5)
        """
        curvature, pull, cost = np.zeros_like(q), np.zeros_like(q), 0.0
        for side, end, sd in bounds.ends:
            beyond = np.where(np.isfinite(end), side * (q - end), -np.inf) / _ROUNDED
            rows, columns = np.nonzero(beyond > -_NOTHING)
            x = beyond[rows, columns]
            weight = sd[columns] ** -2.0 / frames_per_interval
            paid, slope = _ROUNDED * np.logaddexp(0.0, x), expit(x)
            cost += 0.5 * float((weight * np.square(paid)).sum())
            pull[rows, columns] -= side * weight * paid * slope
            curvature[rows, columns] += weight * slope * (slope + paid * (1.0 - slope) / _ROUNDED)
        return cls(curvature, pull, cost)


class JointRanges(CostTerm):
    """Penalty of the coordinates of all trials beyond their ranges."""

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the penalty in a time block."""
        frames = here.time_block.frames
        first = frames.start - here.time_block.with_neighbours.start
        q = here.near_q[first : first + frames.stop - frames.start, self.given.moving]
        add_ranges(into, self.given.bases[here.k], here.time_block, self.given.skeleton.bounds, q)


def add_ranges(into: Gradient, basis: MotionBasis, time_block: TimeBlock, bounds: Bounds, q: np.ndarray) -> None:
    """Add the penalty of the coordinates q (f, c) in the frames of a time block.

    Args:
        into: zero, or with other terms.
        basis: of the motion.
        time_block: of the trial.
        bounds: of the coordinates that move.
        q: rad and m.
    """
    terms = RangeTerms.of(bounds, q, len(basis.first) / basis.size)
    into.cost += terms.cost
    paying = np.flatnonzero(terms.curvature.any(axis=1))
    values = basis.values[0, time_block.frames][paying]
    at = basis.first[time_block.frames][paying] - time_block.splines.start
    columns = np.arange(q.shape[1])
    for i in range(values.shape[1]):
        np.add.at(into.rhs, at + i, values[:, i, None] * terms.pull[paying])
        if isinstance(into, NormalEquations):
            for j in range(i, values.shape[1]):
                square = (values[:, i] * values[:, j])[:, None] * terms.curvature[paying]
                np.add.at(into.band[:, j - i], (at[:, None] + i, columns, columns), square)


class Start(CostTerm):
    """Cost that ties the motion of every trial to its start."""

    def add(self, into: Gradient, here: InTrial) -> None:
        """Add the cost in a time block."""
        add_start(into, here.time_block, here.coefficients - self.given.start[here.k])


def add_start(into: Gradient, time_block: TimeBlock, moved: np.ndarray) -> None:
    """Add the terms of a time block's own splines.

    Args:
        into: zero, or with other terms.
        time_block: of the trial.
        moved: (splines, c) distance of all coefficients of the trial from their start.
    """
    own, following = moved[time_block.splines], moved[time_block.splines.start + 1 : time_block.splines.stop + 1]
    count, pairs = len(own), min(len(following), time_block.size - 1)
    change = following[:pairs] - own[:pairs]
    into.rhs[:count] -= own / AWAY_SD**2
    into.rhs[:pairs] += change / CHANGE_SD**2
    into.rhs[1 : pairs + 1] -= change / CHANGE_SD**2
    into.cost += 0.5 * float(np.square(own / AWAY_SD).sum() + np.square(change / CHANGE_SD).sum())
    if isinstance(into, NormalEquations):
        each = np.arange(moved.shape[1])
        into.band[:count, 0, each, each] += 1.0 / AWAY_SD**2
        into.band[:pairs, 0, each, each] += 1.0 / CHANGE_SD**2
        into.band[1 : pairs + 1, 0, each, each] += 1.0 / CHANGE_SD**2
        into.band[:pairs, 1, each, each] -= 1.0 / CHANGE_SD**2
