"""Measures the marker errors in the frequency band that affects joint moments.

The process that represents the errors (`marker_errors`) matches their slowest part, which carries most information on
what does not move, and their innovation from frame to frame. In between, where the body's accelerations are, it may
have many times the power of skin motion: ten to thirty times on synthetic skin, up to ten times on measured walks. The
estimate hardly depends on it, but standard deviations of joint moments do. So these are computed from the residuals of
the markers at the estimate, within the band of the motion.
"""

from itertools import pairwise

import numpy as np

from kinertia.estimation.simultaneous.linear_algebra.motion_basis import MotionBasis
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.model.kinematic_tree import in_segments
from kinertia.motion.moving_windows import all_around

_UNSEEN = 3.0
"""Power of all errors over that of the observable ones: skin that moves as a block moves the segment, and leaves no
residual. Chosen here; with it, intervals have their nominal coverage in a laboratory whose skin moves as blocks."""
_LEAST_FREE = 0.1
_ENDS = 3
"""Knot intervals beside gaps and ends, where a fitted spline oscillates more than elsewhere."""
_MOST_FRAMES = 6000
"""Number of frames at once: a minute."""
_FREQUENCIES = 400


def motion_noise(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Return the power (3,) of the errors of trial k, their rates and accelerations, relative to what is expected.

    It is at most 1: a single marker that jumps would widen all intervals.

    Args:
        problem: of the estimate.
        k: the trial.
        coefficients: of its motion.
        static: the static unknowns as they are in it.
    """
    trial, basis = problem.trials[k], problem.bases[k]
    spacing_s = float(basis.knots[1] - basis.knots[0])
    squares, counts = np.zeros((3, len(trial.marker_sd))), np.zeros(len(trial.marker_sd))
    counted = trial.dynamic if trial.dynamic.any() or trial.reported is None else trial.reported
    parts = np.linspace(0, len(trial.time), 1 + -(-len(trial.time) // _MOST_FRAMES)).astype(int)
    for frames in (slice(start, stop) for start, stop in pairwise(parts)):
        left = _left(problem, k, coefficients, static, frames)
        n, m, _ = left.shape
        own = MotionBasis(trial.time[frames], spacing_s)
        around = 1 + 2 * int(np.ceil(_ENDS * n / (own.first[-1] + 1)))
        inside = all_around(np.isfinite(left).all(axis=-1), around)
        rows = inside & counted[frames][:, None]
        for square, part in zip(squares, own.evaluate(own.fit(left.reshape(n, -1))), strict=True):
            square += np.where(rows, np.square(part).reshape(n, m, 3).sum(axis=-1), 0.0).sum(axis=0)
        counts += 3 * rows.sum(axis=0)
    seen = counts > 0
    if not seen.any():
        return np.ones(3)
    expected = _expected(problem, k, 0.5 / spacing_s)[:, None] * np.square(trial.marker_process[0][seen])
    found = (squares[:, seen] / counts[seen] / expected).mean(axis=1) / _free(problem, k, counts)
    result: np.ndarray = np.minimum(_UNSEEN * found, 1.0)
    return result


def _left(problem: MapProblem, k: int, coefficients: np.ndarray, static: np.ndarray, frames: slice) -> np.ndarray:
    """Return the residuals (n, m, 3) m of markers and skin, in the axes of the segments; NaN where not seen."""
    q = problem.model.full(problem.bases[k].evaluate(coefficients, frames), static)[0]
    skeleton, trial = problem.model.placed(static), problem.trials[k]
    at = np.ascontiguousarray(skeleton.map.axes(q))
    own = in_segments(skeleton.tree, at, skeleton.marker_segments, np.ascontiguousarray(trial.markers[frames]))
    patterns, along = problem.model.skin(k, static, frames)
    result: np.ndarray = own - skeleton.marker_locals - patterns.displaced(along)
    return result


def _expected(problem: MapProblem, k: int, band_hz: float) -> np.ndarray:
    """Return mean squares (3,) of errors of unit SD, their rates and accelerations, up to this frequency."""
    trial = problem.trials[k]
    step_s = float(np.median(np.diff(trial.time)))
    hz = np.linspace(0.0, band_hz, _FREQUENCIES)
    process = trial.marker_process[1]
    one, two = process.of_before
    turn = np.exp(-2j * np.pi * step_s * hz)
    power = 2.0 * step_s * process.new / np.square(np.abs(1.0 - one * turn - two * turn**2)) / trial.repeats
    return np.array([np.trapezoid(power * (2.0 * np.pi * hz) ** (2 * order), hz) for order in range(3)])


def _free(problem: MapProblem, k: int, counts: np.ndarray) -> float:
    """Return the share of the errors within the band that motion and skin have not absorbed, by counting unknowns."""
    basis = problem.bases[k]
    shown = counts.sum() * basis.size / len(basis.first)
    splines = basis.size * problem.trials[k].dynamic.mean() * len(problem.moving)
    return max(1.0 - float(splines + problem.given.skin[k].size) / float(shown), _LEAST_FREE)
