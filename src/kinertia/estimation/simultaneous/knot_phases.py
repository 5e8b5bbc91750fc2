"""Averages an estimate over where the knots of its splines lie, and adds the spread to its covariance.

Knots are a choice of ours. A trial that begins a frame later has them elsewhere, and what is barely seen (the clock,
plates, single segments) then comes out otherwise, by up to several deviations where the motion has hardly anything
faster than the knots. From the estimate found, others are begun whose knots lie between; they are as good. What does
not move is averaged over all, and how far they are apart is part of its covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.elimination import Eliminated
from kinertia.estimation.simultaneous.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.linearised import Linearised, Point
from kinertia.estimation.simultaneous.problem import MapProblem
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.moving_windows import even_mean

PHASES = (0.5,)
"""Shares of a knot interval by which knots are moved."""


@dataclass(frozen=True, eq=False)
class OfPhases:
    """An estimate averaged over where knots lie.

    Attributes:
        static: (S,) what does not move, averaged.
        covariance: (S, S) of the average, for it is of few.
        problems, points: of each phase, the first one's first.
    """

    static: np.ndarray
    covariance: np.ndarray
    problems: tuple[MapProblem, ...]
    points: tuple[Point, ...]

    @classmethod
    def of(cls, problem: MapProblem, point: Point, search: Callable[[MapProblem, Point], Point]) -> OfPhases:
        """From where a search has ended.

        Args:
            problem: of the estimate.
            point: the end.
            search: from a point of another problem to its optimum.
        """
        problems, points = [problem], [point]
        for phase in PHASES:
            other = problem.of(problem.trials, phase)
            rows = zip(other.bases, problem.bases, point.coefficients, strict=True)
            begin = tuple(new.fit(old.evaluate(part)[0]) for new, old, part in rows)
            problems.append(other)
            points.append(search(other, replace(point, coefficients=begin)))
        every = np.array([each.static for each in points])
        apart = (every - every.mean(axis=0)) / np.sqrt((len(every) - 1) * len(every))
        return cls(every.mean(axis=0), apart.T @ apart, tuple(problems), tuple(points))

    def curves_apart(self, k: int) -> CurveDeviations:
        """Deviations between the phases of the curves of trial k."""
        return curves_apart(self.problems, self.points, k)


def followed(problem: MapProblem, here: Linearised, point: Point, static: np.ndarray) -> Point:
    """The optimum with what does not move held elsewhere, by the quadratic there."""
    model, motions, displaced = GaussNewton.of(problem, here), [], []
    rows = zip(here.trials, model.displaced, problem.displaced_sd, point.coefficients, point.displaced, strict=True)
    for trial, own, sd, part, place in rows:
        step = static - point.static
        moved = -own.gain @ step
        step[problem.layout.displaced] += sd * moved
        motions.append(part + _motion(trial, part, step))
        displaced.append(place + moved)
    return Point(tuple(motions), static, tuple(displaced))


def _motion(trial: Eliminated, part: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(size, c) how the motion of a trial follows a step (S,) of what does not move."""
    return trial.motion_step(trial.forward(np.zeros_like(part))[0], step)


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
