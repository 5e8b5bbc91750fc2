"""Motion, body segment parameters and calibration in one maximum-a-posteriori estimate.

Unknowns: quintic spline coefficients of every coordinate (uniform knots; their spacing follows the cutoff);
log-Cholesky parameters of every segment; static coordinates (joint-centre offsets), marker positions in their segments,
how far they are from these in each of several trials (`marker_offsets`), what is wrong with each plate in all trials
and in each (`plates.PLATE_ERRORS`, `ZERO_UNKNOWNS`), the time offset of the forces, and by how much more they are late
in each of several trials. Minimised is the sum of squares, each over its deviation, of: marker errors, root residuals,
and departures from the priors. Those of the instruments are Gaussians that change with what the data say of them
(`sound_or_faulty`). Gauss-Newton with Levenberg damping, all derivatives analytic. The normal matrix is block
tridiagonal in time with a border of static unknowns (`block_tridiagonal`); its Schur complement is the information on
them, and its inverse their covariance.

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
from kinertia.estimation.simultaneous.elimination import Reduced, reduced
from kinertia.estimation.simultaneous.instruments import InstrumentInformation
from kinertia.estimation.simultaneous.marker_offsets import Displaced, as_displaced
from kinertia.estimation.simultaneous.problem import CalibrationPrior, Linearised, MapProblem, Observation, Point
from kinertia.estimation.simultaneous.sound_or_faulty import GaussianPrior
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


CONVERGED_SD = 0.1
"""Stop after a step that moves body and calibration by less, in posterior deviations of all of them together, ..."""
CONVERGED = 1.0
"""... and promises to lower half the sum of squares by less: what is left to the motion is below its own deviations."""
_FIRST_DAMPING = 1e-5
"""Share of the diagonal. Directions in which motion and parameters make up for one another have hardly more
information: 1e-3 would hold the first steps back."""
_LEAST_DAMPING = 1e-9
_STUCK = 1e6
"""Damping at which no step lowers the cost any more."""
_MAX_ITERATIONS = 100
"""Most trials take 5 to 20; impacts, and arms that reach the ends of their ranges, some 50."""
_NO_IMPACT = 1.05
"""Of `Observation.impact`: below it the motion follows the forces as it is."""
_MOST_THROUGH_IMPACTS = 5
"""Steps of the motion alone; two or three are usual."""
_USUAL_ITERATIONS = 10
_LEFT_ITERATIONS = 2
"""What progress counts with: the usual number, and when these are done always so many more."""


@one_blas_thread
def estimate_simultaneous(
    skeleton: Skeleton,
    prior: BspPrior,
    calibration: CalibrationPrior,
    trials: Sequence[Observation],
    progress: Callable[[float], None] = lambda share: None,
) -> SimultaneousResult:
    """Maximum-a-posteriori motion, BSPs and calibration of one person from one or more trials; `progress` is told the
    share done, guessed from the usual number of steps.
    """
    problem = MapProblem(skeleton, prior, calibration, trials)
    ended = _searched(problem, progress)
    covariance, of_curves = _deviations(problem, ended.under)
    motions = _through_impacts(problem, ended.under.point)
    return _result(problem, ended, motions, covariance, of_curves)


class _Ended(NamedTuple):
    """Where the search ended, under the instruments' last Gaussian; whether short of its limit, after how many steps,
    and from which cost.
    """

    under: Linearised
    instruments: GaussianPrior
    converged: bool
    iterations: int
    begin: float


def _searched(problem: MapProblem, progress: Callable[[float], None]) -> _Ended:
    """Gauss-Newton steps from the beginning until one is short."""
    state = _State(problem.at(problem.beginning, _FIRST_DAMPING), GaussianPrior.of(problem.instruments))
    begin, iterations = state.here.cost, 0
    while iterations < _MAX_ITERATIONS and not state.converged and state.damping < _STUCK:
        iterations += 1
        state = _iterated(problem, state, iterations > 1)
        progress(iterations / (iterations + max(_USUAL_ITERATIONS - iterations, _LEFT_ITERATIONS)))
    under = state.here.under(state.instruments, problem.layout.instruments)
    return _Ended(under, state.instruments, state.converged, iterations, begin)


class _State(NamedTuple):
    """What one iteration leaves to the next: the point, the instruments' Gaussian, the damping, the largest diagonal of
    the information so far (S,), and whether the step was short. All else that it made, which is large, is gone by then.
    """

    here: Linearised
    instruments: GaussianPrior
    damping: float = _FIRST_DAMPING
    scale: np.ndarray | float = 0.0
    converged: bool = False


def _iterated(problem: MapProblem, state: _State, judging: bool) -> _State:
    """After one Gauss-Newton step; the instruments' Gaussian is made anew if `judging`, and if the damping is small."""
    here, instruments, damping, scale, _ = state
    places = problem.layout.instruments
    eliminated = _eliminated(problem, here, damping)
    if judging and damping <= _FIRST_DAMPING:
        instruments = _judged(problem, here, eliminated, instruments)
    under = here.under(instruments, places)
    scale = np.maximum(scale, np.diag(under.information) + sum(np.diag(normal.static) for normal in here.normals))
    held = damping * scale + problem.bends(under)
    there, promised, moved_sd = _step(problem, under, eliminated, damping, held)
    kept = (under.cost - there.under(instruments, places).cost) / promised
    converged = damping <= 1e-3 and promised < CONVERGED and moved_sd < CONVERGED_SD
    return _State(there if kept > 0.0 else here, instruments, _next_damping(damping, kept), scale, converged)


def _judged(problem: MapProblem, here: Linearised, eliminated: Eliminated, instruments: GaussianPrior) -> GaussianPrior:
    """The Gaussian for the instruments that fits what the data say of them at this point."""
    places = problem.layout.instruments
    under = here.under(instruments, places)
    information = under.information + sum(each.information for each in eliminated.displaced)
    right = under.right + sum(each.right for each in eliminated.displaced)
    static_information = StaticInformation.of(information, problem.layout.in_root.stop)
    covariance = np.linalg.inv(static_information.first)
    mean = here.point.static[places] + (covariance @ static_information.first_of(right))[places]
    return instruments.updated(problem.instruments, mean, covariance[places, places])


def _through_impacts(problem: MapProblem, point: Point) -> tuple[np.ndarray, ...]:
    """Coefficients of motions that follow the forces through impacts as elsewhere, with all that does not move held.

    What impacts say of body and instruments counts less (`impacts`); but a motion that did not follow the forces there
    would leave residuals that OpenSim's next tools have to take.
    """
    if all(np.max(trial.impact) < _NO_IMPACT for trial in problem.trials):
        return point.coefficients
    sure = [replace(trial, impact=1.0) for trial in problem.trials]
    following = MapProblem(problem.skeleton, problem.prior, problem.calibration, sure)
    still, result = np.zeros(problem.layout.size), []
    for k, coefficients in enumerate(point.coefficients):
        static = problem.in_trial(k, point)
        for _ in range(_MOST_THROUGH_IMPACTS):
            normal = following.trial_normal(k, coefficients, static, _LEAST_DAMPING)
            move = reduced(normal, _LEAST_DAMPING).motion_step(still)
            coefficients = coefficients + move
            if (normal.right * move).sum() < 2.0 * CONVERGED:
                break
        result.append(coefficients)
    return tuple(result)


def _deviations(problem: MapProblem, here: Linearised) -> tuple[np.ndarray, tuple[CurveDeviations, ...]]:
    """Posterior covariance (S, S) of the static unknowns, and deviations of the curves of every trial."""
    parts, displaced = _eliminated(problem, here, 0.0)
    by_trial = [each.information for each in displaced]
    first = problem.layout.in_root.stop
    root = StaticInformation.of(here.information + sum(by_trial), first).root_of_covariance()
    of_curves = []
    for k, (motion, part) in enumerate(zip(here.point.coefficients, parts, strict=True)):
        in_trial, sd = root, problem.displacement_sd_m[k]
        if sd.any():
            elsewhere = here.information + sum(by_trial[:k] + by_trial[k + 1 :])
            elsewhere = as_displaced(elsewhere, problem.layout.locals, sd)
            in_trial = StaticInformation.of(part.information + elsewhere, first).root_of_covariance()
        static = problem.in_trial(k, here.point)
        of_curves.append(curve_deviations(problem, k, motion, static, part, in_trial))
    return root @ root.T, tuple(of_curves)


class Eliminated(NamedTuple):
    """Normal equations of all trials without motion, and without motion and displacements."""

    parts: list[Reduced]
    displaced: list[Displaced]


def _eliminated(problem: MapProblem, here: Linearised, damping: float) -> Eliminated:
    parts = [reduced(normal, damping) for normal in here.normals]
    rows = zip(parts, problem.displacement_sd_m, here.point.displaced, strict=True)
    places = problem.layout.locals
    return Eliminated(parts, [Displaced.of(part.information, part.right, places, sd, own) for part, sd, own in rows])


def _next_damping(damping: float, kept: float) -> float:
    """The damping after a step that lowered the cost by this share of what it promised."""
    factor = 0.1 if kept > 0.75 else 1.0 if kept > 0.25 else 10.0
    return max(damping * factor, _LEAST_DAMPING)


def _step(
    problem: MapProblem, here: Linearised, eliminated: Eliminated, damping: float, held: np.ndarray
) -> tuple[Linearised, float, float]:
    """Where a step leads that is held back by so much (S,) on the diagonal of the information, by how much it promises
    to lower the cost, and how far body and calibration move, in deviations of all of them together.
    """
    parts, displaced = eliminated
    information = here.information + sum(each.information for each in displaced)
    right = here.right + sum(each.right for each in displaced)
    information[np.diag_indices_from(information)] += held
    step = StaticInformation.of(information, problem.layout.in_root.stop).solution(right)
    moved_squared = float(step @ information @ step)
    # rounding may leave an information that is not positive definite; then nothing has converged
    moved_sd = float(np.sqrt(moved_squared)) if moved_squared >= 0.0 else np.inf
    coefficients, moved = [], []
    promised = 0.5 * float(here.right @ step)
    for k, (part, normal) in enumerate(zip(parts, here.normals, strict=True)):
        old, own = here.point.displaced[k], displaced[k].step(step)
        in_trial = step.copy()
        in_trial[problem.layout.locals] += problem.displacement_sd_m[k] * own
        move = part.motion_step(in_trial)
        coefficients.append(here.point.coefficients[k] + move)
        moved.append(old + own)
        promised += 0.5 * float(normal.static_right @ in_trial + (normal.right * move).sum() - old @ own)
    point = Point(tuple(coefficients), here.point.static + problem.shortened(step), tuple(moved))
    return problem.at(point, _next_damping(damping, 1.0)), promised, moved_sd


def _result(
    problem: MapProblem,
    ended: _Ended,
    motions: Sequence[np.ndarray],
    covariance: np.ndarray,
    of_curves: tuple[CurveDeviations, ...],
) -> SimultaneousResult:
    point, layout = ended.under.point, problem.layout
    values = point.static
    bsp = problem.bsp(values)
    chain = block_diagonal(table_jacobian(values[layout.theta]))
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
        (ended.begin, ended.under.cost),
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
