"""Finds motion, body segment parameters and calibration in one maximum-a-posteriori estimate.

Unknowns are the quintic spline coefficients of every coordinate (uniform knots; their spacing follows the cutoff), and
unknowns of the cost terms that do not move in time (`terms`), some of them displaced in each of several trials
(`model_terms`). The sum of the terms is minimised: squares of marker errors, root residuals and distances from the
priors, each over its standard deviation. Priors of errors of the ground reactions are Gaussians that are adapted to the
data (`mixture_prior`). Steps are Gauss-Newton, corrected by the gradients along the way (`gauss_newton`), with all
derivatives analytic. The normal matrix is block tridiagonal in time with a border of static unknowns
(`block_tridiagonal`); its Schur complement is the information on them, and its inverse their covariance. The estimate
is averaged over knot positions (`marginal_posterior`). At the end some errors get their posterior from the profile of
the cost, and the variance of unknowns that only displace others is added (`marginal_posterior`).

Frames in which forces change faster than the motion can follow have less weight for all unknowns that do not move
(`impacts`). When these are found, the motion alone is made to follow the forces there, too.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation
from kinertia.estimation.simultaneous.outcome import Ended, SimultaneousResult, result_of
from kinertia.estimation.simultaneous.search.gauss_newton import AdaptedPrior, GaussNewton, MotionAlone, SecantPairs
from kinertia.estimation.simultaneous.search.problem import TERMS, Linearised, MapProblem, Point, Slope
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.terms.model_terms import as_displaced
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations, curve_deviations
from kinertia.estimation.simultaneous.uncertainty.evidence import (
    Evidence,
    instrument_support,
    missing_loads,
    suspected_plates,
)
from kinertia.estimation.simultaneous.uncertainty.marginal_posterior import (
    CostProfile,
    OfPhases,
    followed,
    with_left_out,
)
from kinertia.estimation.simultaneous.uncertainty.model_errors import motion_noise
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import (
    Mode,
    PosteriorDraws,
    of_knots,
    of_root,
    posterior_draws,
)
from kinertia.model.skeleton import Skeleton
from kinertia.motion.workload import both, one_blas_thread

CONVERGED = 1e-3
"""Predicted decrease of half the sum of squares below which a step is the last of the search: after one more step, from
a new quadratic, no quantity is further from the optimum than some hundredths of its standard deviation."""
_ENDED = 0.02
"""Predicted decrease of the step with that new quadratic below which the search ends; otherwise it continues."""
_AT_OPTIMUM = 0.1
"""A quadratic that was made as near as this and led to the last step is the last one, too, ..."""
_ACCURATE = 1e-3
"""... and so is one of which the first step left no more than this share of the predicted decrease: the optimum's would
hardly be another."""
_NEAR = 8.0
"""Predicted decrease below which only gradients are recomputed; above it a new quadratic is worth its time."""
_MOST_GRADIENTS = 10
"""Largest number of gradients with one quadratic ..."""
_MOST_GRADIENTS_ALONE = 16
"""... and for the motion alone."""
_FIRST_DAMPING = 1e-5
"""Share of the diagonal. Directions in which motion and parameters compensate for one another have hardly more
information: 1e-3 would limit the first steps."""
_LEAST_DAMPING = 1e-9
_STUCK = 1e6
"""Damping at which the search gives up: no step lowers the cost any more."""
_MAX_ITERATIONS = 60
"""Largest number of quadratics; most trials take 2 to 6."""
_MOST_TRIES = 5
"""Largest number of ever shorter steps tried along one direction."""
_LEAST_KEPT = 1e-3
"""Least share of the predicted decrease that a step must achieve."""
_NO_IMPACT = 1.05
"""Value of `Observation.impact` below which the motion follows the forces as it is."""
_MOTION_CONVERGED = 3e-4
"""As CONVERGED, for the motion alone."""
_MOST_THROUGH_IMPACTS = 5
"""Largest number of quadratics for the motion alone; one or two are usual."""
_CONTINUED = 0.01
"""As CONVERGED, for an estimate that differs only in its knots: they are some tenths of a standard deviation apart, and
averaged."""
_MOST_CONTINUED = 3
"""Largest number of quadratics from an optimum to that with other knots; one is usual."""
_AVERAGED, _AVERAGED_SHARE = 20.0, 0.01
"""What the average over knot positions may add to the cost, in half the square of standard deviations, or as a share of
what the search has taken off: usual are 0.1 to 5, and in drop jumps 33, a thousandth. Where it adds more, there are
several optima, and what lies between them is none: on stairs with an unmeasured step it undid all of the search."""
_USUAL_ITERATIONS = 5
_LEFT_ITERATIONS = 2
"""Numbers used for progress: usual iterations, and further ones that always follow."""


@one_blas_thread
def estimate_simultaneous(
    skeleton: Skeleton,
    prior: BspPrior,
    calibration: CalibrationPrior,
    trials: Sequence[Observation],
    progress: Callable[[float], None] = lambda share: None,
    otherwise: Sequence[Observation] = (),
    terms: Sequence[type[CostTerm]] = TERMS,
    with_draws: bool = True,
) -> SimultaneousResult:
    """Estimate motion, BSPs and calibration of one person from one or more trials (maximum a posteriori).

    `progress` is called with the share done, guessed from the usual number of steps. `otherwise` are the same trials
    with other ground reactions, whose evidence is computed for comparison. `terms` are those of the cost. Without draws
    from the posterior, all else is the same.
    """
    problem = MapProblem(skeleton, prior, calibration, trials, terms=terms)
    ended, model = _optimum(problem, progress)
    if model.static.is_rounded:
        problem = MapProblem(skeleton, prior, calibration, trials, terms=terms, precise=True)
        ended, model = _optimum(problem, progress)
    evidence = Evidence.of(model, ended.instruments, otherwise)
    known = AdaptedPrior.elsewhere(ended.instruments)
    phases, profile = both(
        lambda: OfPhases.of(problem, ended.point, partial(_continued, adapted=known)),
        lambda: CostProfile.of(model, ended.instruments, ended.point, partial(_with_fixed_delay, problem)),
    )
    there = ended._replace(here=profile.here, instruments=profile.instruments)
    model = GaussNewton.of(problem, there.here).under(there.instruments)
    moved, more = _left_out(problem, model, ended.point.static)
    static, (begin, end) = ended.point.static, ended.cost
    averaged = phases.static - static
    between = followed(model, ended.point, static + problem.shortened_static(averaged))
    more_cost = max(_AVERAGED, _AVERAGED_SHARE * (begin - end))
    if problem.slope(between).under(ended.instruments)[0] >= end + more_cost:
        averaged = np.zeros_like(static)
    moved += profile.static - static
    point = followed(model, ended.point, static + problem.shortened_static(averaged + moved))
    ended = there._replace(point=point)
    roots = _roots_in_trials(problem, ended, model)
    modes = [of_knots(phases), *of_root(model, point, more)]
    motions, (covariance, curves, draws) = both(
        lambda: _through_impacts(problem, point),
        lambda: _uncertainty(problem, ended, model, (roots, more), modes if with_draws else None, phases),
    )
    covariance += phases.covariance + more @ more.T
    support = instrument_support(model, ended.point, ended.instruments, curves)
    result = result_of(problem, ended, motions, covariance, curves, support, evidence, draws)
    return replace(result, missing_loads=missing_loads(problem, ended.point, suspected_plates(result.calibration)))


def _optimum(problem: MapProblem, progress: Callable[[float], None]) -> tuple[Ended, GaussNewton]:
    """Search for the optimum; return it with the quadratic there, under the instruments' Gaussian."""
    ended = _searched(problem, progress)
    return ended, GaussNewton.of(problem, ended.here).under(ended.instruments)


def _left_out(problem: MapProblem, model: GaussNewton, static: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the change (S,) of static unknowns (S,) by `with_left_out`, a root (S, u) of the covariance added."""
    directions = problem.left_out(static)
    data = sum(eliminated.information for eliminated in model.displaced) @ directions
    pull = -directions.T @ problem.prior_slope(static)[0]
    root = model.static.root_of_covariance()
    return with_left_out(directions, data, pull, root @ root.T)


def _searched(problem: MapProblem, progress: Callable[[float], None]) -> Ended:
    """Take quasi-Newton steps with one quadratic after another until a step is short, then one with a new quadratic."""
    at = _Place(problem.beginning, np.inf, AdaptedPrior.at_first(problem.layout.error_priors))
    begin, damping, scale, iterations = np.inf, _FIRST_DAMPING, np.zeros(problem.layout.size), 0
    while True:
        iterations += 1
        last = at.converged or damping > _STUCK or iterations == _MAX_ITERATIONS
        damping = _LEAST_DAMPING if last else damping
        here = problem.at(at.point, damping)
        begin = here.slope.cost if iterations == 1 else begin
        scale = np.maximum(scale, np.diag(here.information) + sum(trial.static_diagonal for trial in here.trials))
        static = here.point.like(here.slope.rhs).static
        model = GaussNewton.of(problem, here, damping * scale + problem.second_derivatives(static))
        progress(iterations / (iterations + max(_USUAL_ITERATIONS - iterations, _LEFT_ITERATIONS)))
        if last:
            end = _last_step(problem, model, at)
            if end.converged or not at.converged or iterations >= _MAX_ITERATIONS:
                return _ended(begin, end, here, iterations)
        at = _descended(problem, model, here.slope, at.adapted, iterations > 1, CONVERGED)
        if at.converged and at.holds and damping == _LEAST_DAMPING:
            return _ended(begin, at, here, iterations)
        stuck = at.point is here.point
        damping = max(100.0 * damping, 1e-4) if stuck else max(1e-4 * damping, _LEAST_DAMPING)


def _ended(begin: float, at: "_Place", here: Linearised, iterations: int) -> Ended:
    return Ended(at.point, here, at.adapted.gaussian, at.converged, iterations, (begin, at.cost))


class _Place(NamedTuple):
    """State of the search.

    The point, the cost there under the instruments' Gaussian, that Gaussian, whether the last step was short, and
    whether the last quadratic is about that of the optimum.
    """

    point: Point
    cost: float
    adapted: AdaptedPrior
    converged: bool = False
    holds: bool = False


def _continued(problem: MapProblem, point: Point, adapted: AdaptedPrior) -> Point:
    """Return the optimum, starting from a point near it and from the instruments' Gaussian there.

    The first step is the motion's alone: splines with other knots have other accelerations, and what does not move
    would be adjusted to these. The Gaussian is updated with the data at these knots. Its precision may be negative
    where fault-free and faulty are both likely; with other data, such a Gaussian would let the error grow without
    limit.
    """
    alone = MotionAlone(problem.at(point, _LEAST_DAMPING, bordered=False))
    at = _descended(problem, alone, alone.here.slope, adapted, False, _CONTINUED, 1)
    for _ in range(_MOST_CONTINUED):
        here = problem.at(at.point, _LEAST_DAMPING)
        model = GaussNewton.of(problem, here, problem.second_derivatives(here.point.like(here.slope.rhs).static))
        at = _descended(problem, model, here.slope, at.adapted, True, _CONTINUED)
        if at.converged:
            break
    return at.point


def _with_fixed_delay(
    problem: MapProblem, model: GaussNewton, slope: Slope, instruments: GaussianPrior
) -> tuple[np.ndarray, float]:
    """Return the static unknowns (S,) and the cost at the optimum with this Gaussian for the instruments.

    The search begins at the optimum with another Gaussian, of which it needs the gradient.
    """
    at = _descended(problem, model, slope, AdaptedPrior.elsewhere(instruments), False, CONVERGED)
    return at.point.static, at.cost


def _descended(
    problem: MapProblem,
    model: GaussNewton | MotionAlone,
    slope: Slope,
    adapted: AdaptedPrior,
    adapting: bool,
    tolerance: float,
    most: int = _MOST_GRADIENTS,
) -> _Place:
    """Take quasi-Newton steps with one quadratic, as long as they are worthwhile."""
    pairs, places, began, holds = SecantPairs(), slope.instruments, np.inf, False
    model = model.under(adapted.gaussian)
    for count in range(most):
        step, promised = _answer(slope, model, pairs, adapted)
        if adapting and isinstance(model, GaussNewton):
            again = _adapted_again(problem, model, slope.point, step, adapted, max(promised, 0.0))
            if again is not adapted:
                pairs = pairs.stiffer(places, again.gaussian.precision - adapted.gaussian.precision)
                adapted, model = again, model.under(again.gaussian)
                step, promised = _answer(slope, model, pairs, adapted)
        began = began if count else promised
        holds = holds or promised < (_ACCURATE * began if count == 1 else _AT_OPTIMUM if count == 0 else 0.0)
        if 0.0 <= promised < tolerance:
            return _moved(problem, slope, step, promised, adapted, holds)
        if (count and promised > _NEAR) or not promised > 0.0:
            break
        there = _lower(problem, slope, adapted.gaussian, step, promised)
        if there is None:
            break
        taken = there.point.vector - slope.point.vector
        change = slope.rhs - there.rhs
        change[places] += adapted.gaussian.precision @ taken[places]
        expected = 2.0 * promised * float(taken @ step) / float(step @ step)
        slope, pairs = there, pairs.with_pair(taken, change, expected)
    return _Place(slope.point, slope.under(adapted.gaussian)[0], adapted)


def _answer(
    slope: Slope, model: GaussNewton | MotionAlone, pairs: SecantPairs, adapted: AdaptedPrior
) -> tuple[np.ndarray, float]:
    """Return the step of all unknowns, and its predicted decrease of the cost; both are under the same Gaussian."""
    rhs = slope.under(adapted.gaussian)[1]
    step = pairs.step(rhs, model.step)
    return step, 0.5 * float(rhs @ step)


def _adapted_again(
    problem: MapProblem, model: GaussNewton, point: Point, step: np.ndarray, adapted: AdaptedPrior, far: float
) -> AdaptedPrior:
    """Update the instruments' Gaussian, given the step from a point to the optimum."""
    mean, covariance = model.of_instruments(point, step)
    return adapted.again(problem.layout.error_priors, mean, covariance, far)


def _moved(
    problem: MapProblem, slope: Slope, step: np.ndarray, promised: float, adapted: AdaptedPrior, holds: bool = False
) -> _Place:
    """Move the point by a step that is too short to need a new cost and gradient: as the quadratic promised."""
    point = slope.point.like(slope.point.vector + problem.shortened(slope.point, step))
    return _Place(point, slope.under(adapted.gaussian)[0] - promised, adapted, True, holds)


def _last_step(problem: MapProblem, model: GaussNewton, at: _Place) -> _Place:
    """Take a step with the last quadratic, if the search has converged and the step is short."""
    slope, adapted, pairs = model.here.slope, at.adapted, SecantPairs()
    here = _Place(slope.point, slope.under(adapted.gaussian)[0], adapted)
    if not at.converged:
        return here
    model = model.under(adapted.gaussian)
    step, _ = _answer(slope, model, pairs, adapted)
    adapted = _adapted_again(problem, model, slope.point, step, adapted, 0.0)
    step, promised = _answer(slope, model.under(adapted.gaussian), pairs, adapted)
    return (
        _moved(problem, slope, step, promised, adapted) if 0.0 <= promised < _ENDED else here._replace(adapted=adapted)
    )


def _lower(
    problem: MapProblem, slope: Slope, instruments: GaussianPrior, step: np.ndarray, promised: float
) -> Slope | None:
    """Find a point along a step where the cost is lower by a fair share of what was predicted; None without one."""
    cost, share, start = slope.under(instruments)[0], 1.0, slope.point.vector
    for _ in range(_MOST_TRIES):
        there = problem.slope(slope.point.like(start + problem.shortened(slope.point, share * step)))
        kept = (cost - there.under(instruments)[0]) / promised
        if kept > _LEAST_KEPT * share:
            return there
        # minimum of the parabola through cost and slope at the start, and this cost
        best = share**2 / (2.0 * share - kept) if np.isfinite(kept) else 0.0
        share = min(max(best, 0.1 * share), 0.6 * share)
    return None


def _through_impacts(problem: MapProblem, point: Point) -> tuple[np.ndarray, ...]:
    """Return coefficients of motions that follow the forces even in impacts, with all static unknowns fixed.

    In the estimate, impacts have less weight for body and instruments (`impacts`); but a motion that did not follow the
    forces there would leave residuals in OpenSim's subsequent tools. These use rigid segments only: the motion must
    also follow other effects on the forces.
    """
    rigid = problem.layout.rigid(point.static)
    if all(np.max(trial.impact) < _NO_IMPACT for trial in problem.trials) and (rigid == point.static).all():
        return point.coefficients
    sure = [replace(trial, impact=1.0) for trial in problem.trials]
    following = problem.of(sure)
    at = _Place(replace(point, static=rigid), np.inf, AdaptedPrior.at_first(following.layout.error_priors))
    for _ in range(_MOST_THROUGH_IMPACTS):
        alone = MotionAlone(following.at(at.point, _LEAST_DAMPING, bordered=False))
        slope, most = alone.here.slope, _MOST_GRADIENTS_ALONE
        at = _descended(following, alone, slope, at.adapted, False, _MOTION_CONVERGED, most)
        if at.converged:
            break
    return at.point.coefficients


def _uncertainty(
    problem: MapProblem,
    ended: Ended,
    model: GaussNewton,
    uncertain: tuple[Sequence[np.ndarray], np.ndarray],
    modes: Sequence[Mode] | None,
    phases: OfPhases,
) -> tuple[np.ndarray, tuple[CurveDeviations, ...], PosteriorDraws | None]:
    """Return covariance (S, S) of the static unknowns with these knots, SDs of the curves of every trial, and draws.

    `uncertain` are the roots of `_roots_in_trials` and that of `_left_out`, `modes` its effects and those of the knots;
    None for no draws.
    """
    root, point, of_curves, noises = model.static.root_of_covariance(), ended.point, [], []
    roots, more = uncertain
    for k, (trial, root_in_trial) in enumerate(zip(ended.here.trials, roots, strict=True)):
        in_trial = np.hstack([model.in_trial(k, more), root_in_trial])
        here = point.coefficients[k], problem.in_trial(k, point)
        # errors that recur count more often only for what does not move
        noises.append(motion_noise(problem, k, *here) / problem.trials[k].repeats)
        deviations = curve_deviations(problem, k, *here, trial, in_trial, noises[-1])
        of_curves.append(deviations.and_of(phases.curves_apart(k)))
    draws = None if modes is None else posterior_draws(model, point, roots, noises, modes)
    return root @ root.T, tuple(of_curves), draws


def _roots_in_trials(problem: MapProblem, ended: Ended, model: GaussNewton) -> list[np.ndarray]:
    """Return, per trial, a root (S, S) of the posterior covariance of the static unknowns as they are in it."""
    here, layout = ended.here, problem.layout
    root, first, roots = model.static.root_of_covariance(), layout.in_root.stop, []
    for k, trial in enumerate(here.trials):
        in_trial, sd = root, problem.displaced_sd[k]
        if sd.any():
            elsewhere = here.information + sum(
                eliminated.information for j, eliminated in enumerate(model.displaced) if j != k
            )
            elsewhere[layout.errors, layout.errors] += ended.instruments.precision
            elsewhere = as_displaced(elsewhere, layout.displaced, sd)
            in_trial = StaticInformation.of(trial.information + elsewhere, first).root_of_covariance()
        roots.append(in_trial)
    return roots
