"""Computes loads on the feet if the delay of the forces is known only to a standard deviation.

At foot contact and foot off, forces change within a shorter time, and a time derivative does not describe the effect of
a delay. It is replaced by the regression of the loads on the delay, over all likely delays (statistical linearisation),
which enters like a derivative. Its residual is added as independent. Both together are the mean square change of the
loads, however they change.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.motion.ground_reactions import GroundReactions

_DELAYS = np.linspace(-4.0, 4.0, 25)
"""Delays in standard deviations, over which the mean squares are taken."""


@dataclass(frozen=True)
class DelayedLoads:
    """Loads (N, N m) at n times on right and left foot, and the effect of a delay.

    Attributes:
        loads: (n, 2, 6) without delay.
        slope: (n, 2, 6) per s of delay.
        residual: (n, m, 2, 6) residuals from the slope for m delays, times the root of their probability, so that
            the sum of squares is a mean square; empty (m = 0) if the delay is known.
    """

    loads: np.ndarray
    slope: np.ndarray
    residual: np.ndarray


def delayed_loads(reactions: GroundReactions, time: np.ndarray, sd_s: float = 0.0) -> DelayedLoads:
    """Compute the loads at times (n,) s for a delay with this SD (s); with zero SD the slope is the derivative."""
    loads, rates = reactions.with_rate(time)
    n = len(time)
    if sd_s == 0.0:
        return DelayedLoads(loads, rates, np.empty((n, 0, 2, 6)))
    weights = np.exp(-0.5 * np.square(_DELAYS))
    weights /= weights.sum()
    delays = sd_s * _DELAYS
    later = reactions.at((time[:, None] + delays).ravel())
    changes = later.reshape(n, len(delays), 12) - loads.reshape(n, 1, 12)
    slope = (weights * delays / (weights @ np.square(delays))) @ changes
    residual = np.sqrt(weights)[:, None] * (changes - delays[:, None] * slope[:, None])
    return DelayedLoads(loads, slope.reshape(n, 2, 6), residual.reshape(n, -1, 2, 6))
