"""Averages an estimate over the positions of its splines' knots, and adds the spread to its covariance.

Knots are an arbitrary choice. A trial that begins a frame later has them elsewhere, and poorly determined unknowns
(delay, plates, single segments) then differ, by up to several standard deviations where the motion has hardly anything
faster than the knots. From the estimate, others are started with knots in between; they are equally good. Unknowns that
do not move are averaged over all of them, and their spread is part of their covariance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import MapProblem, Point
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import body_joints, joint_moments
from kinertia.motion.moving_windows import even_mean
from kinertia.motion.workload import pieces

PHASES = (0.5,)
"""Shares of a knot interval by which knots are shifted."""


@dataclass(frozen=True, eq=False)
class OfPhases:
    """An estimate averaged over knot positions.

    Attributes:
        static: (S,) unknowns that do not move, averaged.
        covariance: (S, S) of the average, since it is over few.
        problems, points: of each phase, starting with the original.
    """

    static: np.ndarray
    covariance: np.ndarray
    problems: tuple[MapProblem, ...]
    points: tuple[Point, ...]

    @classmethod
    def of(cls, problem: MapProblem, point: Point, search: Callable[[MapProblem, Point], Point]) -> Self:
        """Average over knot positions, from the point where a search has ended.

        Args:
            problem: of the estimate.
            point: end of the search.
            search: leads from a point of another problem to its optimum.
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
        """Return the standard deviations between the phases of the curves of trial k."""
        return curves_apart(self.problems, self.points, k)


def followed(model: GaussNewton, point: Point, static: np.ndarray) -> Point:
    """Return the optimum with the static unknowns fixed at other values, by the quadratic at a point."""
    problem, motions, displaced = model.problem, [], []
    trials = zip(model.here.trials, model.displaced, problem.displaced_sd, strict=True)
    rows = zip(trials, point.coefficients, point.displaced, strict=True)
    for (trial, own, sd), part, place in rows:
        step = static - point.static
        moved = -own.gain @ step
        step[problem.layout.displaced] += sd * moved
        motions.append(part + trial.following(step))
        displaced.append(place + moved)
    return Point(tuple(motions), static, tuple(displaced))


_KNOTS = 2.0
"""Half of the interval over which their squares are averaged, in knot intervals: few estimates may agree by chance."""


def curves_apart(problems: Sequence[MapProblem], points: Sequence[Point], k: int) -> CurveDeviations:
    """Return the standard deviations between estimates of the curves of trial k."""
    frames, basis = problems[0].trials[k].curve_frames, problems[0].bases[k]
    statics = [problem.in_trial(k, point) for problem, point in zip(problems, points, strict=True)]
    reactions = [problem.loads.reactions(k, static) for problem, static in zip(problems, statics, strict=True)]
    estimates = [(each.coefficients[k], static) for each, static in zip(points, statics, strict=True)]
    joints = len(body_joints(problems[0].skeleton))
    variances = CurveDeviations.filled(len(frames), len(problems[0].moving), joints, 0.0)
    for some in pieces(len(frames)):
        rows = zip(problems, estimates, reactions, strict=True)
        every = [_curves(problem, k, *estimate, loads, frames[some]) for problem, estimate, loads in rows]
        for variance, *each in zip(variances.curves, *every, strict=True):
            variance[some] = np.var(each, axis=0, ddof=1)
    around = 1 + 2 * round(_KNOTS * len(basis.first) / basis.intervals)
    for variance in variances.curves:
        variance[:] = even_mean(variance, around)
    return variances.roots()


def _curves(
    problem: MapProblem,
    k: int,
    coefficients: np.ndarray,
    static: np.ndarray,
    reactions: GroundReactions,
    frames: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return coordinates, moments, powers, ground reactions and loads of joints at these frames of trial k."""
    motion = Motion(*problem.model.full(problem.bases[k].evaluate(coefficients, frames), static))
    loads = reactions.at(problem.trials[k].time[frames])
    skeleton, bsp = problem.model.placed(static), problem.model.bsp(static)
    moments = inverse_dynamics(skeleton, bsp, motion, loads)[:, problem.moving]
    q, speed = motion.q[:, problem.moving], motion.qd[:, problem.moving]
    joints = joint_moments(skeleton, bsp, motion, loads)
    return q, moments, moments * speed, loads[..., :3], np.stack([joints.moments, joints.forces], axis=2)
