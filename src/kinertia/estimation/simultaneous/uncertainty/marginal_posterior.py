"""Integrates the posterior over what one point misses: delays along the profile of the cost, and positions of knots.

Knots are an arbitrary choice. A trial that begins a frame later has them elsewhere, and poorly determined unknowns
(delay, plates, single segments) then differ, by up to several standard deviations where the motion has hardly anything
faster than the knots. From the estimate, others are started with knots in between; they are equally good. Unknowns that
do not move are averaged over all of them, and their spread is part of their covariance.

A single linearisation makes the delay too certain: changes of force over milliseconds are correlated with motion and
body, and the second derivatives that Gauss-Newton leaves out make the profile a fifth to a quarter wider in walks.
Whether delayed or synchronous forces are likelier depends on its width exponentially. The profile is therefore
evaluated at three delays, and its parabola, less what soft tissue lags, combined with the priors of the synchronisation
delay and of the trial's own delay, each with two components.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, GaussianPrior
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import Linearised, MapProblem, Point, Slope
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import body_joints, joint_moments
from kinertia.motion.workload import pieces
from kinertia.trial.sampled_data import even_mean

PHASES = (0.5,)
"""Shares of a knot interval by which knots are shifted."""
_FIXING = 1e6
"""Information that fixes the delay where the profile is evaluated, relative to what is known of it."""


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
        every = np.array([phase_point.static for phase_point in points])
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
    for (trial, eliminated, sd), part, place in rows:
        step = static - point.static
        moved = -eliminated.gain @ step
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
    estimates = [(phase_point.coefficients[k], static) for phase_point, static in zip(points, statics, strict=True)]
    joints = len(body_joints(problems[0].skeleton))
    variances = CurveDeviations.filled(len(frames), len(problems[0].moving), joints, 0.0)
    for some in pieces(len(frames)):
        rows = zip(problems, estimates, reactions, strict=True)
        every = [_curves(problem, k, *estimate, loads, frames[some]) for problem, estimate, loads in rows]
        for variance, *samples in zip(variances.curves, *every, strict=True):
            variance[some] = np.var(samples, axis=0, ddof=1)
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
    motion = Motion(*problem.model.full(problem.bases[k].evaluate_steady(coefficients, frames), static))
    loads = reactions.at(problem.trials[k].time[frames])
    skeleton, bsp = problem.model.placed(static), problem.model.bsp(static)
    moments = inverse_dynamics(skeleton, bsp, motion, loads)[:, problem.moving]
    q, speed = motion.q[:, problem.moving], motion.qd[:, problem.moving]
    joints = joint_moments(skeleton, bsp, motion, loads)
    return q, moments, moments * speed, loads[..., :3], np.stack([joints.moments, joints.forces], axis=2)


@dataclass(frozen=True, eq=False)
class CostProfile:
    """An estimate with the delay's posterior from its profile; unchanged for several trials.

    Attributes:
        here: the quadratic, with the profile's information on the delay.
        instruments: the Gaussian with the means and standard deviations of synchronisation and trial delay.
        static: (S,) the unknowns, with the others adjusted to these.
    """

    here: Linearised
    instruments: GaussianPrior
    static: np.ndarray

    @classmethod
    def of(
        cls,
        model: GaussNewton,
        instruments: GaussianPrior,
        point: Point,
        search: Callable[[GaussNewton, Slope, GaussianPrior], tuple[np.ndarray, float]],
    ) -> Self:
        """Compute the profile from the point where a search has ended.

        Args:
            model: the last quadratic, under the Gaussian that replaces the instruments' priors.
            instruments: that Gaussian.
            point: end of the search.
            search: returns the static unknowns and the cost at the optimum with another Gaussian, from this quadratic
                and the gradient at the point.
        """
        problem, here = model.problem, model.here
        late, first = np.array(problem.profiled(), dtype=int), problem.layout.errors.start
        priors = [problem.layout.error_priors.individual[k] for k in late - first]
        unchanged = cls(here, instruments, point.static)
        if not len(late):
            return unchanged
        root = model.static.root_of_covariance()
        across, places, values = root @ root[late].T, late - first, point.static[late]
        known = np.linalg.inv(across[late])
        sd = float(np.sqrt(across[late].sum()))
        delays = np.array([-sd, 0.0, sd])
        fixed = [_fixed(instruments, places, values + away / len(places), _FIXING / sd**2) for away in delays]
        slope = problem.slope(point)
        costs = [_without(fixed_prior, places, *search(model, slope, fixed_prior), first) for fixed_prior in fixed]
        curve, slope, _ = np.polyfit(delays, costs, 2)
        if not curve > 0.0:
            return unchanged
        imitated, imitated_sd = problem.imitated()
        certain = 1.0 / (0.5 / curve + imitated_sd**2)
        shown = np.full((len(places), len(places)), certain)
        rhs = np.full(len(places), certain * (values.sum() - 0.5 * slope / curve - imitated))
        gaussian = GaussianPrior.given(ErrorPriors(tuple(priors)), shown, rhs)
        found = np.linalg.solve(shown + gaussian.precision, rhs + gaussian.pull)
        linear = (known - instruments.precision[np.ix_(places, places)]).mean()
        information = here.information.copy()
        information[np.ix_(late, late)] += shown - linear
        return cls(
            replace(here, information=information),
            _with(instruments, places, gaussian.precision, gaussian.pull),
            point.static + across @ known @ (found - values),
        )


def _without(gaussian: GaussianPrior, places: np.ndarray, static: np.ndarray, cost: float, first: int) -> float:
    """Return a cost under a Gaussian without its prior of some quantities, which begin at `first` in `static` (S,)."""
    alone = GaussianPrior(gaussian.precision[np.ix_(places, places)], gaussian.pull[places])
    return cost - alone.cost(static[first + places])


def _fixed(gaussian: GaussianPrior, places: np.ndarray, values: np.ndarray, information: float) -> GaussianPrior:
    """Return the Gaussian with some quantities fixed at these values by this much information on each."""
    return _with(gaussian, places, information * np.eye(len(places)), information * values)


def _with(gaussian: GaussianPrior, places: np.ndarray, precision: np.ndarray, pull: np.ndarray) -> GaussianPrior:
    """Return the Gaussian with precision and pull of some quantities replaced."""
    every, pulls = gaussian.precision.copy(), gaussian.pull.copy()
    every[np.ix_(places, places)], pulls[places] = precision, pull
    return GaussianPrior(every, pulls)


def with_left_out(
    directions: np.ndarray, data: np.ndarray, pull: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the effect of u more unknowns of unit standard deviation that displace the others, as seen by the data.

    It returns (S,) how far the estimate moves back to the prior, and (S, u) a root of what is added to its covariance.

    Args:
        directions: (S, u) displacements of the unknowns.
        data: (S, u) information of the data on the unknowns, times these.
        pull: (u,) of the data along them, at the estimate without these unknowns.
        covariance: (S, S) without them.

    >>> one = np.ones((1, 1))
    >>> moved, root = with_left_out(one, 99.0 * one, np.array([1.98]), 0.01 * one)  # 1.98 +- 0.1, prior 0 +- 1
    >>> moved.round(2), (root @ root.T).round(2)
    (array([-0.99]), array([[0.49]]))
    """
    carried = covariance @ data
    left, along = np.linalg.eigh(np.eye(len(pull)) + directions.T @ data - data.T @ carried)
    # never below the prior's; rounding makes it so where other priors are next to exact
    root = carried @ (along / np.sqrt(np.maximum(left, 1.0)))
    return -root @ (along.T @ pull / np.sqrt(np.maximum(left, 1.0))), root
