"""Takes quasi-Newton steps (L-BFGS) on top of a known quadratic.

Gauss-Newton leaves out second derivatives of the residuals. Along a few nearly flat directions these are as large as
what it retains: there its steps are repeatedly up to twice too long, or half as long as they should be. A pair of a
step and of the change of the gradient along it corrects the quadratic in that direction (Liu and Nocedal 1989, Math
Program 45:503), and a gradient takes a tenth of the time of a new quadratic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_MOST_PAIRS = 16
_LEAST_CURVATURE = 0.02
"""Share of the expected curvature along a step; pairs with less are discarded."""


@dataclass(frozen=True, eq=False)
class SecantPairs:
    """Pairs of steps taken (n,) and of the decrease of the gradient along each (n,).

    >>> pairs = SecantPairs().with_pair(np.array([1.0, 0.0]), np.array([2.0, 0.0]), expected=1.0)
    >>> pairs.step(np.array([4.0, 3.0]), lambda rhs: rhs)
    array([2., 3.])
    """

    steps: tuple[np.ndarray, ...] = ()
    changes: tuple[np.ndarray, ...] = ()

    def with_pair(self, step: np.ndarray, change: np.ndarray, expected: float) -> SecantPairs:
        """Append a pair, in place of the oldest of many, if the step shows a fair share of the expected curvature."""
        if not step @ change > _LEAST_CURVATURE * expected:
            return self
        return SecantPairs((*self.steps, step)[-_MOST_PAIRS:], (*self.changes, change)[-_MOST_PAIRS:])

    def stiffer(self, places: slice, more: np.ndarray) -> SecantPairs:
        """Return the pairs after the cost has gained this information (m, m) on some of the unknowns."""
        changes = tuple(change.copy() for change in self.changes)
        for step, change in zip(self.steps, changes, strict=True):
            change[places] += step[places] @ more
        return SecantPairs(self.steps, changes)

    def step(self, rhs: np.ndarray, known: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Compute the step (n,) for a right-hand side, given `known`, which computes it without these pairs."""
        pairs = [(step, change, 1.0 / (step @ change)) for step, change in zip(self.steps, self.changes, strict=True)]
        left, shares = rhs.copy(), []
        for step, change, inverse in reversed(pairs):
            shares.append(inverse * (step @ left))
            left -= shares[-1] * change
        result = known(left)
        for (step, change, inverse), share in zip(pairs, reversed(shares), strict=True):
            result += (share - inverse * (change @ result)) * step
        return result
