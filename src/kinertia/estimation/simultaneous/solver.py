"""Motion, body segment parameters and calibration in one maximum-a-posteriori estimate.

Unknowns: quintic spline coefficients of every coordinate (uniform knots; their spacing follows the cutoff);
log-Cholesky parameters of every segment; static coordinates (joint-centre offsets), marker positions in their segments,
how far they are from these in each of several trials (`marker_offsets`), what is wrong with each plate in all trials
and in each (`plates.PLATE_ERRORS`, `ZERO_UNKNOWNS`), the time offset of the forces, and by how much more they are late
in each of several trials. Minimised is the sum of squares, each over its deviation, of: marker errors, root residuals,
and departures from the priors. Those of the instruments are Gaussians that change with what the data say of them
(`sound_or_faulty`). Steps are those of Gauss and Newton (`gauss_newton`), corrected by the gradients along the way
(`quasi_newton`), all derivatives analytic. The normal matrix is block tridiagonal in time with a border of static
unknowns (`block_tridiagonal`); its Schur complement is the information on them, and its inverse their covariance.

Frames in which forces change faster than the motion can follow say less of all that does not move (`impacts`). When
that is settled, the motion alone is made to follow the forces there, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.curve_deviations import CurveDeviations, curve_deviations
from kinertia.estimation.simultaneous.evidence import Evidence
from kinertia.estimation.simultaneous.gauss_newton import GaussNewton, MotionAlone
from kinertia.estimation.simultaneous.instrument_support import InstrumentSupport, instrument_support
from kinertia.estimation.simultaneous.instruments import InstrumentInformation
from kinertia.estimation.simultaneous.linearised import Linearised, Point, Slope
from kinertia.estimation.simultaneous.marker_offsets import as_displaced
from kinertia.estimation.simultaneous.problem import CalibrationPrior, MapProblem, Observation
from kinertia.estimation.simultaneous.quasi_newton import SecantPairs
from kinertia.estimation.simultaneous.sound_or_faulty import ErrorPriors, GaussianPrior
from kinertia.estimation.simultaneous.static_information import StaticInformation
from kinertia.model.bsp import BodySegmentParameters, block_diagonal
from kinertia.model.log_cholesky import table_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.one_thread import one_blas_thread


@dataclass(frozen=True)
class SimultaneousResult:
    """Outcome of `estimate_simultaneous`.

    Attributes:
        bsp: the estimate, physically consistent.
        bsp_covariance: (10 s, 10 s) posterior covariance of its table rows, segment after segment.
        skeleton: with the estimated marker positions and static coordinates.
        coordinates: static coordinate -> (value, posterior deviation), rad or m.
        plates: per plate what is wrong with it (5,), in the order of PLATE_ERRORS, and the posterior deviations (5,).
        clock_s: the time offset and its posterior deviation, s.
        delays_s: of several trials, how much later the forces of each are, and the posterior deviation, s.
        zeros_n: per trial, per plate what it reads too much (2,), in the order of ZERO_UNKNOWNS, and the posterior
            deviations (2,).
        foot_loads: per trial (n, 2, 6) loads on the feet, of instruments put right, of the motion's bandwidth.
        reactions: per trial the loads for the joint moments, of instruments put right.
        motions: per trial q, qd, qdd at its frames.
        displacements_m: per trial (m, 3) how far its markers are from their places in the segments.
        curve_deviations: per trial the posterior deviations of its curves at its dynamic frames.
        instruments: what these trials say of plates and clock, to be added to what others say.
        converged: the last step was short: CONVERGED_SD, CONVERGED.
        iterations: Gauss-Newton steps taken.
        cost: half the sum of squares, at the start and at the end.
        support: what supports an accusation of each instrument.
        evidence: how likely the trials are, and the same read otherwise.
    """

    bsp: BodySegmentParameters
    bsp_covariance: np.ndarray
    skeleton: Skeleton
    coordinates: dict[str, tuple[float, float]]
    plates: dict[str, tuple[np.ndarray, np.ndarray]]
    clock_s: tuple[float, float]
    delays_s: tuple[tuple[float, float], ...]
    zeros_n: tuple[dict[str, tuple[np.ndarray, np.ndarray]], ...]
    foot_loads: tuple[np.ndarray, ...]
    reactions: tuple[GroundReactions, ...]
    motions: tuple[Motion, ...]
    displacements_m: tuple[np.ndarray, ...]
    curve_deviations: tuple[CurveDeviations, ...]
    instruments: InstrumentInformation
    converged: bool
    iterations: int
    cost: tuple[float, float]
    support: InstrumentSupport
    evidence: Evidence


CONVERGED = 3e-3
"""Promised decrease of half the sum of squares below which a step is the last of the search: with the one at the end of
it, from a quadratic of its own, no quantity is then further from the optimum than some hundredths of its deviation."""
_ENDED = 0.05
"""What that one may promise; else the search goes on."""
_NEAR = 8.0
"""Promised decrease from which on gradients alone are followed: above it a new quadratic is worth its time."""
_MOST_GRADIENTS = 10
"""With one quadratic."""
_BLOCKED = 0.5
"""Share of a step: where no more of it can be taken, coordinates meet the ends of their ranges."""
_FIRST_DAMPING = 1e-5
"""Share of the diagonal. Directions in which motion and parameters make up for one another have hardly more
information: 1e-3 would hold the first steps back."""
_LEAST_DAMPING = 1e-9
_STUCK = 1e6
"""Damping at which no step lowers the cost any more."""
_MAX_ITERATIONS = 60
"""Quadratics; most trials take 5 to 7."""
_MOST_TRIES = 5
"""Steps along one direction, each shorter."""
_LEAST_KEPT = 1e-3
"""Share of the promised decrease that a step must bring."""
_ALIKE_SD = 0.02
"""Instruments are judged again when what is said of them has moved by more, in deviations of all of them together..."""
_ALIKE_SHARE = 0.3
"""... and by more than this share of how far everything is from the optimum."""
_NO_IMPACT = 1.05
"""Of `Observation.impact`: below it the motion follows the forces as it is."""
_MOTION_CONVERGED = 3e-4
"""As CONVERGED, of the motion alone."""
_MOST_THROUGH_IMPACTS = 5
"""Quadratics for the motion alone; one or two are usual."""
_USUAL_ITERATIONS = 5
_LEFT_ITERATIONS = 2
"""What progress counts with: the usual number, and when these are done always so many more."""


@one_blas_thread
def estimate_simultaneous(
    skeleton: Skeleton,
    prior: BspPrior,
    calibration: CalibrationPrior,
    trials: Sequence[Observation],
    progress: Callable[[float], None] = lambda share: None,
    otherwise: Sequence[Observation] = (),
) -> SimultaneousResult:
    """Maximum-a-posteriori motion, BSPs and calibration of one person from one or more trials; `progress` is told the
    share done, guessed from the usual number of steps. `otherwise` are the same trials with other ground reactions, to
    be told how likely these would be.
    """
    problem = MapProblem(skeleton, prior, calibration, trials)
    ended = _searched(problem, progress)
    model = GaussNewton.of(problem, ended.here).under(ended.instruments)
    covariance, of_curves = _deviations(problem, ended, model)
    motions = _through_impacts(problem, ended.point)
    support = instrument_support(model, ended.point, ended.instruments, of_curves)
    evidence = Evidence.of(model, ended.instruments, otherwise)
    return _result(problem, ended, motions, covariance, of_curves, support, evidence)


class _Ended(NamedTuple):
    """Where the search ended, the quadratic there and the instruments' last Gaussian; whether short of its limit, after
    how many quadratics, from which cost and at which.
    """

    point: Point
    here: Linearised
    instruments: GaussianPrior
    converged: bool
    iterations: int
    cost: tuple[float, float]


def _searched(problem: MapProblem, progress: Callable[[float], None]) -> _Ended:
    """Quasi-Newton steps with one quadratic after another until a step is short; then one with one of its own."""
    at = _Place(problem.slope(problem.beginning), _Judged.at_first(problem))
    begin, damping, scale, iterations = at.slope.cost, _FIRST_DAMPING, np.zeros(problem.layout.size), 0
    while True:
        iterations += 1
        last = at.converged or damping > _STUCK or iterations == _MAX_ITERATIONS
        at_ends = last or not at.slow
        damping = _LEAST_DAMPING if last else damping
        here = problem.at(at.slope.point, damping, at_ends)
        scale = np.maximum(scale, np.diag(here.information) + sum(trial.static_diagonal for trial in here.trials))
        static = here.point.like(here.slope.right).static
        model = GaussNewton.of(problem, here, damping * scale + problem.bends(static))
        progress(iterations / (iterations + max(_USUAL_ITERATIONS - iterations, _LEFT_ITERATIONS)))
        if last:
            end = _last_step(problem, model, at)
            if end.converged or not at.converged or iterations >= _MAX_ITERATIONS:
                cost = begin, end.slope.under(end.judged.gaussian)[0]
                return _Ended(end.slope.point, here, end.judged.gaussian, end.converged, iterations, cost)
        at = _descended(problem, model, at._replace(slope=here.slope), at_ends, iterations > 1, CONVERGED)
        stuck = at.slope.point is here.point
        damping = max(100.0 * damping, 1e-4) if stuck else max(0.01 * damping, _LEAST_DAMPING)


class _Judged(NamedTuple):
    """The instruments' Gaussian, and the mean that it gave them (k,) when it was made."""

    gaussian: GaussianPrior
    mean: np.ndarray

    @classmethod
    def at_first(cls, problem: MapProblem) -> _Judged:
        """Before the data have said anything."""
        return cls(GaussianPrior.of(problem.instruments), np.full(len(problem.instruments.own), np.inf))

    def again(self, priors: ErrorPriors, mean: np.ndarray, covariance: np.ndarray, far: float) -> _Judged:
        """From the posterior mean and covariance under this one; the same where the mean has hardly moved beside how
        far everything is from the optimum, in half the square of deviations.
        """
        information, away = np.linalg.inv(covariance), mean - self.mean
        alike = max(_ALIKE_SD**2, _ALIKE_SHARE**2 * 2.0 * far)
        if np.isfinite(away).all() and away @ information @ away < alike:
            return self
        gaussian = self.gaussian.updated(priors, mean, covariance)
        right = information @ mean - self.gaussian.pull + gaussian.pull
        return _Judged(gaussian, np.linalg.solve(information - self.gaussian.precision + gaussian.precision, right))


class _Place(NamedTuple):
    """Where the search is, whether the last step was short, and whether gradients with the last quadratic all brought
    something, to the last of them: what it takes for held at the ends of ranges may then keep the search back.
    """

    slope: Slope
    judged: _Judged
    converged: bool = False
    slow: bool = False


def _descended(
    problem: MapProblem, model: GaussNewton | MotionAlone, at: _Place, at_ends: bool, judging: bool, tolerance: float
) -> _Place:
    """Quasi-Newton steps with one quadratic, as long as they are worth it."""
    slope, judged = at.slope, at.judged
    pairs, places = SecantPairs.none(len(slope.right)), slope.instruments
    for count in range(_MOST_GRADIENTS):
        step, promised = _answer(slope, model, pairs, judged)
        if judging and isinstance(model, GaussNewton):
            again = _judged_again(problem, model, slope.point, step, judged, max(promised, 0.0))
            if again is not judged:
                pairs = pairs.stiffer(places, again.gaussian.precision - judged.gaussian.precision)
                judged = again
                step, promised = _answer(slope, model, pairs, judged)
        if 0.0 <= promised < tolerance:
            return _Place(_moved(problem, slope, step), judged, True)
        if (count and promised > _NEAR) or not promised > 0.0:
            break
        there = _lower(problem, slope, judged.gaussian, step, promised)
        if there is None:
            break
        taken = there.point.vector - slope.point.vector
        if not at_ends and np.linalg.norm(taken) < _BLOCKED * np.linalg.norm(step):
            return _Place(there, judged)
        change = slope.right - there.right
        change[places] += judged.gaussian.precision @ taken[places]
        expected = 2.0 * promised * float(taken @ step) / float(step @ step)
        slope, pairs = there, pairs.with_pair(taken, change, expected)
    else:
        return _Place(slope, judged, slow=True)
    return _Place(slope, judged)


def _answer(
    slope: Slope, model: GaussNewton | MotionAlone, pairs: SecantPairs, judged: _Judged
) -> tuple[np.ndarray, float]:
    """The step of all unknowns, and by how much it promises to lower the cost."""
    right = slope.under(judged.gaussian)[1]
    step = pairs.step(right, model.under(judged.gaussian).step)
    return step, 0.5 * float(right @ step)


def _judged_again(
    problem: MapProblem, model: GaussNewton, point: Point, step: np.ndarray, judged: _Judged, far: float
) -> _Judged:
    """The instruments, if this step leads from a point to the optimum."""
    mean, covariance = model.under(judged.gaussian).of_instruments(point, step)
    return judged.again(problem.instruments, mean, covariance, far)


def _moved(problem: MapProblem, slope: Slope, step: np.ndarray) -> Slope:
    """After a step too short to ask for cost and gradient again."""
    return replace(slope, point=slope.point.like(slope.point.vector + problem.shortened(slope.point, step)))


def _last_step(problem: MapProblem, model: GaussNewton, at: _Place) -> _Place:
    """After a step with the last quadratic, if the search has converged and the step is short."""
    slope, judged, pairs = model.here.slope, at.judged, SecantPairs.none(len(model.here.slope.right))
    if not at.converged:
        return _Place(slope, judged)
    step, _ = _answer(slope, model, pairs, judged)
    judged = _judged_again(problem, model, slope.point, step, judged, 0.0)
    step, promised = _answer(slope, model, pairs, judged)
    return _Place(_moved(problem, slope, step), judged, True) if 0.0 <= promised < _ENDED else _Place(slope, judged)


def _lower(
    problem: MapProblem, slope: Slope, instruments: GaussianPrior, step: np.ndarray, promised: float
) -> Slope | None:
    """A point along a step at which the cost is lower by a fair share of what was promised; None if there is none."""
    cost, share, start = slope.under(instruments)[0], 1.0, slope.point.vector
    for _ in range(_MOST_TRIES):
        there = problem.slope(slope.point.like(start + problem.shortened(slope.point, share * step)))
        kept = (cost - there.under(instruments)[0]) / promised
        if kept > _LEAST_KEPT * share:
            return there
        # where the parabola of cost and slope at the start, and of this cost, is lowest
        best = share**2 / (2.0 * share - kept) if np.isfinite(kept) else 0.0
        share = min(max(best, 0.1 * share), 0.6 * share)
    return None


def _through_impacts(problem: MapProblem, point: Point) -> tuple[np.ndarray, ...]:
    """Coefficients of motions that follow the forces through impacts as elsewhere, with all that does not move held.

    What impacts say of body and instruments counts less (`impacts`); but a motion that did not follow the forces there
    would leave residuals that OpenSim's next tools have to take.
    """
    if all(np.max(trial.impact) < _NO_IMPACT for trial in problem.trials):
        return point.coefficients
    sure = [replace(trial, impact=1.0) for trial in problem.trials]
    following = MapProblem(problem.skeleton, problem.prior, problem.calibration, sure)
    at = _Place(following.slope(point), _Judged.at_first(following))
    for _ in range(_MOST_THROUGH_IMPACTS):
        at_ends = not at.slow
        alone = MotionAlone.of(following, at.slope.point, _LEAST_DAMPING, at_ends)
        at = _descended(following, alone, at, at_ends, judging=False, tolerance=_MOTION_CONVERGED)
        if at.converged:
            break
    return at.slope.point.coefficients


def _deviations(
    problem: MapProblem, ended: _Ended, model: GaussNewton
) -> tuple[np.ndarray, tuple[CurveDeviations, ...]]:
    """Posterior covariance (S, S) of the static unknowns, and deviations of the curves of every trial."""
    here, point, layout = ended.here, ended.point, problem.layout
    root, first = model.static.root_of_covariance(), layout.in_root.stop
    of_curves = []
    for k, (motion, trial) in enumerate(zip(point.coefficients, here.trials, strict=True)):
        in_trial, sd = root, problem.displacement_sd_m[k]
        if sd.any():
            elsewhere = here.information + sum(each.information for j, each in enumerate(model.displaced) if j != k)
            elsewhere[layout.instruments, layout.instruments] += ended.instruments.precision
            elsewhere = as_displaced(elsewhere, layout.locals, sd)
            in_trial = StaticInformation.of(trial.information + elsewhere, first).root_of_covariance()
        of_curves.append(curve_deviations(problem, k, motion, problem.in_trial(k, point), trial, in_trial))
    return root @ root.T, tuple(of_curves)


def _result(
    problem: MapProblem,
    ended: _Ended,
    motions: Sequence[np.ndarray],
    covariance: np.ndarray,
    of_curves: tuple[CurveDeviations, ...],
    support: InstrumentSupport,
    evidence: Evidence,
) -> SimultaneousResult:
    point, layout = ended.point, problem.layout
    values = point.static
    bsp = problem.bsp(values)
    # of the point at which the covariance is
    chain = block_diagonal(table_jacobian(ended.here.point.static[layout.theta]))
    sd = np.sqrt(np.diag(covariance))
    names = list(problem.calibration.coordinates)
    coordinates = {
        name: (float(value), float(dev))
        for name, value, dev in zip(names, values[layout.coordinates], sd[layout.coordinates], strict=True)
    }
    markers = problem.placed(values).markers
    skeleton = problem.skeleton.with_markers(markers).lock({name: value for name, (value, _) in coordinates.items()})
    plates = zip(problem.plate_errors(values), problem.plate_sd(covariance), strict=True)
    zeros = [(layout.zeros_of(k), trial.ground.plates) for k, trial in enumerate(problem.trials)]
    return SimultaneousResult(
        bsp,
        chain @ covariance[layout.theta, layout.theta] @ chain.T,
        skeleton,
        coordinates,
        dict(zip(problem.plates, plates, strict=True)),
        (float(values[layout.clock]), float(sd[layout.clock])),
        tuple(zip(values[layout.delays].tolist(), sd[layout.delays].tolist(), strict=True)),
        tuple(dict(zip(names, zip(values[at], sd[at], strict=True), strict=True)) for at, names in zeros),
        tuple(problem.foot_loads(k, values) for k in range(len(problem.trials))),
        tuple(problem.reactions(k, values) for k in range(len(problem.trials))),
        tuple(Motion(*basis.evaluate(part)) for basis, part in zip(problem.bases, motions, strict=True)),
        tuple((d * own).reshape(-1, 3) for d, own in zip(problem.displacement_sd_m, point.displaced, strict=True)),
        of_curves,
        _shown(
            problem, ended.instruments, values[layout.instruments], covariance[layout.instruments, layout.instruments]
        ),
        ended.converged,
        ended.iterations,
        ended.cost,
        support,
        evidence,
    )


def _shown(
    problem: MapProblem, prior: GaussianPrior, mean: np.ndarray, covariance: np.ndarray
) -> InstrumentInformation:
    """What the trials say of the laboratory's instruments, without what was known before."""
    session, own = problem.session, slice(problem.layout.laboratory.stop - problem.layout.laboratory.start, len(mean))
    more = (0, own.stop - own.start)
    before = ((prior.precision, prior.pull), (np.pad(session.information, more), np.pad(session.right, more)))
    shown = InstrumentInformation.of_posterior(problem.plates, mean, covariance, before)
    return shown.without_own(prior.precision[own, own], prior.pull[own])
