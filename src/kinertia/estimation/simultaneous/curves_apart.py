"""Measures how far apart curves of estimates are that differ only in where knots lie (`knot_phases`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.linearised import Point
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.moving_windows import even_mean

_KNOTS = 2.0
"""Half of the stretch over which their squares are averaged, in knot intervals: few estimates are alike by chance."""


def curves_apart(problems: Sequence[MapProblem], points: Sequence[Point], k: int) -> CurveDeviations:
    """Deviations between estimates of the curves of trial k."""
    every = [_curves(problem, k, point) for problem, point in zip(problems, points, strict=True)]
    basis = problems[0].bases[k]
    around = 1 + 2 * round(_KNOTS * len(basis.first) / (basis.size - 5))
    parts = [np.stack(each) for each in zip(*every, strict=True)]
    variances = [even_mean(each.var(axis=0, ddof=1), around) for each in parts]
    return CurveDeviations(*(np.sqrt(np.maximum(each, 0.0)) for each in variances))


def _curves(problem: MapProblem, k: int, point: Point) -> tuple[np.ndarray, ...]:
    """Coordinates, moments, powers and ground reactions at the dynamic frames."""
    frames = np.flatnonzero(problem.trials[k].dynamic)
    static = problem.in_trial(k, point)
    motion = Motion(*problem.model.full(problem.bases[k].evaluate(point.coefficients[k], frames), static))
    loads = problem.loads.reactions(k, static).at(problem.trials[k].time[frames])
    moments = inverse_dynamics(problem.model.placed(static), problem.model.bsp(static), motion, loads)[
        :, problem.moving
    ]
    q, speed = motion.q[:, problem.moving], motion.qd[:, problem.moving]
    return q, moments, moments * speed, loads[..., :3]
