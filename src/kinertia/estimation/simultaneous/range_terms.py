"""Terms of the coordinates' ranges in a trial's normal equations: beyond its range a coordinate pays, within it not.

Where markers hardly show a coordinate, the turn of a forearm above all, the estimate would send it through poses that
no joint has, in long steps that do not end. What is paid is one-sided: the square of what is beyond, over a deviation,
once per knot interval. Where the model clamps a range the deviation is so small that the coordinate stays at the end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.estimation.simultaneous.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.normal_equations import Gradient, NormalEquations
from kinertia.estimation.simultaneous.stretches import Stretch
from kinertia.model.coordinate_range import Bounds

CLAMPED_SD = 0.01
"""Rad or m beyond a range that the model clamps: half a degree."""
SD = 0.35
"""Rad or m beyond another range: 20 degrees. A shoulder may go there."""


class RangeTerms(NamedTuple):
    """What coordinates (n, c) pay.

    Attributes:
        weight: (n, c) 1 / variance where the coordinate is beyond its range, or at its end, else zero.
        pull: (n, c) back into the range: minus what it is beyond, times the weight.
        cost: half the sum of squares.
    """

    weight: np.ndarray
    pull: np.ndarray
    cost: float

    @classmethod
    def of(cls, bounds: Bounds, q: np.ndarray, frames_per_interval: float, at_ends: bool = True) -> RangeTerms:
        """Of coordinates q (n, c), rad and m.

        What is within the range, but nearer to a clamped end than its deviation, pays nothing, and cannot go far
        beyond: its deviation is told as that of a coordinate beyond. A search that took it for held would crawl; it
        asks without what is `at_ends`.

        >>> import numpy as np
        >>> bounds = Bounds.of(("elbow",), {"elbow": Range(0.0, 2.6, clamped=True)})
        >>> terms = RangeTerms.of(bounds, np.array([[1.0], [2.61]]), frames_per_interval=1.0)
        >>> terms.weight.ravel().round(), round(terms.cost, 3)
        (array([    0., 10000.]), 0.5)
        """
        beyond = bounds.beyond(q)
        margin = CLAMPED_SD if at_ends else 0.0
        clamped = (q < bounds.least + margin) | (q > bounds.most - margin)
        weight = (clamped | (beyond != 0.0)) / np.where(clamped, CLAMPED_SD, SD) ** 2 / frames_per_interval
        return cls(weight, -weight * beyond, 0.5 * float((weight * np.square(beyond)).sum()))


def add_ranges(
    into: Gradient, basis: MotionBasis, stretch: Stretch, bounds: Bounds, q: np.ndarray, at_ends: bool = True
) -> None:
    """Add what the coordinates q (f, c) of the frames of a stretch pay beyond their ranges.

    Args:
        into: zero, or with other terms.
        basis: of the motion.
        stretch: of the trial.
        bounds: of the coordinates that move.
        q: rad and m.
        at_ends: as `RangeTerms.of` has it.
    """
    terms = RangeTerms.of(bounds, q, len(basis.first) / basis.size, at_ends)
    into.cost += terms.cost
    paying = np.flatnonzero(terms.weight.any(axis=1))
    values = basis.values[0, stretch.frames][paying]
    at = basis.first[stretch.frames][paying] - stretch.splines.start
    columns = np.arange(q.shape[1])
    for i in range(values.shape[1]):
        np.add.at(into.right, at + i, values[:, i, None] * terms.pull[paying])
        if isinstance(into, NormalEquations):
            for j in range(i, values.shape[1]):
                square = (values[:, i] * values[:, j])[:, None] * terms.weight[paying]
                np.add.at(into.band[:, j - i], (at[:, None] + i, columns, columns), square)
