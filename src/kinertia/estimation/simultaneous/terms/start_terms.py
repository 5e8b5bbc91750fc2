"""Ties the motion to its start where neither markers nor forces determine it.

The outermost splines hardly affect the data, and markers may be missing for a while. A spline coefficient that nothing
else determines follows its neighbours: its change from the start may vary from one coefficient to the next by
CHANGE_SD. The change itself is nearly free, AWAY_SD. Otherwise each of the thousands of coefficients of a long trial
would fix a constant offset of a joint angle, which misplaced markers have put into the start, and count it as known.
"""

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.frame_blocks import TimeBlock
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import Gradient, NormalEquations
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, InTrial

CHANGE_SD, AWAY_SD = 1.0, 30.0
"""Standard deviations (rad or m): of the difference from one coefficient to the next, and of each by itself."""


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
