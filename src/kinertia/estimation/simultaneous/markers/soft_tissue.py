"""Increases root errors while the body is accelerated, since soft tissue swings after the bones.

Trials of one person on the same plates disagreed about synchronisation, plates and masses, jumps most of all, as long
as a frame of a jump counted as much as a frame of standing. The error of rigid segments is proportional to the force
that accelerates the body.
"""

import numpy as np

from kinertia.motion.moving_windows import even_mean

SWING = 0.008
"""Root error per force that accelerates the body. Chosen on one person's trials: jumps, squats and walks agree about
their instruments as well as with 0.03, which costs walks some percent of the hip and back moments, the more the less
certain a plate is."""
_SWING_S = 0.1
"""Duration over which that force is averaged: soft tissue continues to swing for so long."""


def swing_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, weight_n: float, usual_n: float
) -> np.ndarray:
    """Return the factors (n,) by which the SD of the root residual is larger because the body is accelerated.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, of the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        weight_n: of the body.
        usual_n: standard deviation of the root residual of one frame within the band, without acceleration.

    >>> time, standing = np.arange(100) / 100, np.full(100, 700.0)
    >>> flight = np.where(time < 0.5, standing, 0.0)
    >>> factors = swing_factors(time, np.outer(flight, [0.0, 1.0, 0.0]), np.ones(100, bool), 700.0, 3.5)
    >>> factors[[20, 80]].round(2)
    array([1.  , 1.89])
    """
    accelerating = np.where(dynamic[:, None], force - [0.0, weight_n, 0.0], 0.0)
    frames = 1 + 2 * round(0.5 * _SWING_S * (len(time) - 1) / (time[-1] - time[0]))
    square = np.maximum(even_mean(np.square(accelerating).sum(axis=1), frames), 0.0)
    return np.sqrt(1.0 + square * (SWING / usual_n) ** 2)
