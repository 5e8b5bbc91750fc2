"""Lets root errors grow while the body is accelerated: soft tissue swings after its bones.

Trials of one person on the same plates contradicted one another about the clock, plates and masses, jumps most of all,
as long as a frame of a jump counted as much as one of standing. What rigid segments leave out is in proportion to the
force that accelerates the body.
"""

from __future__ import annotations

import numpy as np

from kinertia.motion.moving_windows import even_mean

SWING = 0.008
"""Root error per force that accelerates the body. Set on one person's trials: jumps, squats and walks agree about their
instruments as well as with 0.03, which costs walks some percent of the hip's and the back's moments, and the more the
less sure a plate is."""
_SWING_S = 0.1
"""Over which the size of that force is taken: soft parts swing on for so long."""


def swing_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, weight_n: float, usual_n: float
) -> np.ndarray:
    """(n,) by how much the deviations of the root residual are larger because the body is accelerated.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, of the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        weight_n: of the body.
        usual_n: deviation of the root residual of one frame within the band where nothing is accelerated.

    >>> time, standing = np.arange(100) / 100, np.full(100, 700.0)
    >>> flight = np.where(time < 0.5, standing, 0.0)
    >>> factors = swing_factors(time, np.outer(flight, [0.0, 1.0, 0.0]), np.ones(100, bool), 700.0, 3.5)
    >>> factors[[20, 80]].round(2)
    array([1.  , 1.89])
    """
    accelerating = np.where(dynamic[:, None], force - [0.0, weight_n, 0.0], 0.0)
    frames = 1 + 2 * round(0.5 * _SWING_S * (len(time) - 1) / (time[-1] - time[0]))
    square = np.maximum(even_mean(np.square(accelerating).sum(axis=1), frames), 0.0)
    result: np.ndarray = np.sqrt(1.0 + square * (SWING / usual_n) ** 2)
    return result
