"""Loads on the feet when the delay of the forces is known to a deviation only.

Where a foot lands or leaves, forces change within less than that deviation, and a derivative by time says nothing of
what a delay does. In its place is the regression of the loads on the delay, over all delays that are likely
(statistical linearisation): it goes with the other unknowns as a derivative does. What it leaves is added as
independent. Both together are the mean square change of the loads, however they change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.motion.ground_reactions import GroundReactions

_DELAYS = np.linspace(-4.0, 4.0, 25)
"""In deviations; of these the mean squares are."""


@dataclass(frozen=True)
class LateLoads:
    """Loads (N, N m) at n times on right and left foot, and what a delay does.

    Attributes:
        loads: (n, 2, 6) without any.
        slope: (n, 2, 6) per s of delay.
        left: (m, n, 2, 6) of m delays, what the slope does not explain, times the root of their probability: the sum of
            squares is a mean square. None where the delay is known.
    """

    loads: np.ndarray
    slope: np.ndarray
    left: np.ndarray


def late_loads(reactions: GroundReactions, time: np.ndarray, sd_s: float = 0.0) -> LateLoads:
    """At times (n,) s of reactions whose delay has this deviation; without one the slope is the derivative."""
    loads, rates = reactions.with_rate(time)
    if sd_s == 0.0:
        return LateLoads(loads, rates, np.empty((0, *loads.shape)))
    weights = np.exp(-0.5 * np.square(_DELAYS))
    weights /= weights.sum()
    delays = sd_s * _DELAYS
    changes = np.array([reactions.at(time + delay) for delay in delays]) - loads
    slope = np.tensordot(weights * delays, changes, 1) / (weights @ np.square(delays))
    along, roots = (each[:, None, None, None] for each in (delays, np.sqrt(weights)))
    return LateLoads(loads, slope, roots * (changes - along * slope))
