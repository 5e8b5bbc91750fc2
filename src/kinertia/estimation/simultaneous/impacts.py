"""Finds where ground reactions change faster than the motion can, and weighs them less there.

When a foot lands, soft parts of the body swing after its bones, and the sum of the forces has a part that splines of
the motion's bandwidth cannot make. Which of it they can make depends on where the landing lies between two knots. Taken
as sure as in other frames, these frames would pull the motion about, and the clock to where the landing suits the
knots: of a walk whose forces were moved in steps, the clock followed in jumps of a knot interval, tens of deviations
wide, and with the wrong sign as often as not. With these frames counting less, three of the nine parameters that
contradicted the literature in thirteen measured trials do so no more.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_lsq_spline

from kinertia.motion.moving_windows import greatest
from kinertia.trial.sampled_time import runs

_BESIDE = 2.0
"""What a body with soft parts does otherwise than rigid segments, over what is beyond the bandwidth: it does not end
there. Set here: with it the clock of two measured walks follows when their forces are moved, with 1 it jumps, and with
4 a clock that is off is taken for a plate that is."""
_PHASES = 4
"""Ways for the knots to lie, over which what the splines leave is averaged."""
_FEWEST_FRAMES = 8
_LESS_WEIGHT = 2.0
"""Times the deviation of other frames from which on a frame counts a quarter or less."""


def impact_factors(
    time: np.ndarray, force: np.ndarray, dynamic: np.ndarray, spacing_s: float, force_sd: float
) -> np.ndarray:
    """(n,) by how much the deviations of the root residual are larger because of what the motion cannot follow.

    The acceleration of a quintic spline is a cubic one with the same knots: what such splines leave of the force counts
    as an error of it, in the frames within half a knot interval.

    Args:
        time: (n,) s, of the frames.
        force: (n, 3) N, sum of the ground reactions, of the motion's bandwidth.
        dynamic: (n,) frames whose root residual counts.
        spacing_s: of the motion's knots.
        force_sd: of the root residual elsewhere, N.

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
    """Share of the frames (n,) that count a quarter or less for these factors of their deviations."""
    return float((factors >= _LESS_WEIGHT).mean()) if len(factors) else 0.0


def _left(time: np.ndarray, force: np.ndarray, spacing_s: float) -> np.ndarray:
    """(n,) N, root mean square over axes and ways for the knots to lie of what cubic splines leave of the force."""
    square = np.zeros(len(time))
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES:
        inner = np.arange(time[0] + phase * spacing_s, time[-1], spacing_s)
        knots = np.concatenate([[time[0]] * 4, inner[inner < time[-1]], [time[-1]] * 4])
        # knots this even keep normal equations well conditioned; scipy's QR takes time that grows with the square
        spline = make_lsq_spline(time, force, knots, k=3, method="norm-eq")
        square += np.square(force - spline(time)).mean(axis=1) / _PHASES
    return np.sqrt(square)
