"""Detects frames in which forces are followed less: impacts, and soft tissue that swings after the bones.

When a foot lands, soft tissue swings after the bones, and the sum of the forces has a part that splines of the motion's
bandwidth cannot reproduce. Which part they can reproduce depends on where the landing lies between two knots. With full
weight, these frames would distort the motion, and shift the synchronisation delay to where the landing suits the knots:
for a walk whose forces were shifted in steps, the delay followed in jumps of a knot interval, tens of standard
deviations wide, and with the wrong sign as often as not. With less weight for these frames, three of the nine
parameters that contradicted the literature in thirteen measured trials no longer do.

Trials of one person on the same plates disagreed about synchronisation, plates and masses, jumps most of all, as long
as a frame of a jump counted as much as a frame of standing. The error of rigid segments is proportional to the force
that accelerates the body.
"""

import numpy as np
from scipy.interpolate import make_lsq_spline

from kinertia.trial.sampled_data import even_mean, greatest, runs

_BESIDE = 2.0
"""Ratio of the difference between a soft body and rigid segments to what is beyond the bandwidth, since the difference
does not end there. Chosen here: with it the estimated delay of two measured walks follows when their forces are
shifted, with 1 it jumps, and with 4 a delay is attributed to a plate."""
_PHASES = 4
"""Number of knot positions over which the residual of the splines is averaged."""
_FEWEST_FRAMES = 8
_LESS_WEIGHT = 2.0
"""Ratio to the standard deviation of other frames above which a frame has at most a quarter of the weight."""
SWING = 0.008
"""Root error per force that accelerates the body. Chosen on one person's trials: jumps, squats and walks agree about
their instruments as well as with 0.03, which costs walks some percent of the hip and back moments, the more the less
certain a plate is."""
_SWING_S = 0.1
"""Duration over which that force is averaged: soft tissue continues to swing for so long."""


def impact_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, spacing_s: float, force_sd: float
) -> np.ndarray:
    """Return the factors (n,) by which the SD of the root residual is larger because of forces that the motion cannot
    follow.

    The acceleration of a quintic spline is a cubic spline with the same knots: what such splines leave of the force
    counts as its error, in the frames within half a knot interval.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, at the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        spacing_s: of the motion's knots.
        force_sd: standard deviation of the root residual elsewhere, N.

    >>> time = np.arange(100) / 100
    >>> push = 700.0 + 300.0 * np.exp(-(((time - 0.5) / 0.01) ** 2))
    >>> factors = impact_factors(time, np.outer(push, [0.0, 1.0, 0.0]), np.ones(100, bool), 1 / 30, 4.0)
    >>> bool(factors[50] > 10.0), float(factors[:20].max().round(2))
    (True, 1.0)
    """
    result = np.ones(len(time))
    for first, last in runs(dynamic):
        if last - first + 1 < _FEWEST_FRAMES:
            continue
        own = slice(first, last + 1)
        step_s = (time[last] - time[first]) / (last - first)
        spacing = max(spacing_s, 2.0 * step_s)
        left = _left(time[own], force[own], spacing)
        near = greatest(left, 1 + 2 * round(0.5 * spacing / step_s))
        result[own] = np.sqrt(1.0 + np.square(_BESIDE * near / force_sd))
    return result


def down_weighted(factors: np.ndarray) -> float:
    """Return the share of the frames (n,) that have at most a quarter of the weight with these factors."""
    return float((factors >= _LESS_WEIGHT).mean()) if len(factors) else 0.0


def _left(time: np.ndarray, force: np.ndarray, spacing_s: float) -> np.ndarray:
    """Return the RMS (n,) N, over axes and knot positions, of the residual of the force from cubic splines."""
    square = np.zeros(len(time))
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES:
        inner = np.arange(time[0] + phase * spacing_s, time[-1], spacing_s)
        knots = np.concatenate([[time[0]] * 4, inner[inner < time[-1]], [time[-1]] * 4])
        # knots this even keep normal equations well conditioned; the time of scipy's QR grows with the square
        spline = make_lsq_spline(time, force, knots, k=3, method="norm-eq")
        square += np.square(force - spline(time)).mean(axis=1) / _PHASES
    return np.sqrt(square)


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
