"""Tests whether errors of instruments are credible, and compares the evidence for interpretations of a recording.

A gain multiplies all of a plate's load: in every contact, in every phase of stance, horizontal and vertical alike.
Where the load is missing in one phase only, or only vertically, no gain corrects both. The quadratic at the optimum,
with the shares of `missing_loads` added, gives the evidence for either.

The estimate corrects every instrument error that it finds. Many of them may be errors of the model: soft tissue that
lags looks like delayed forces, a bending trunk like a displaced plate. Users who are asked to check a plate should find
an error there. So an error must matter, by its effect on joint moments, and be present in every trial.

The evidence is the probability of the data with all unknowns integrated out: motion, body and calibration by the
quadratic at the optimum (Laplace), instruments by their exact priors, fault-free or faulty in every combination. The
lowest cost alone would favour the interpretation that needs a faulty instrument, since its wide prior hardly costs
anything.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtri

from kinertia.estimation.simultaneous.instruments.instrument_errors import GAIN, INTERVAL_SD, POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture, GaussianPrior, log_chance
from kinertia.estimation.simultaneous.observation import Observation
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.problem import MapProblem, Point, Slope
from kinertia.estimation.simultaneous.terms.instrument_term import (
    MISSING,
    MISSING_SD,
    InstrumentErrors,
    LoadPart,
    MissingLoads,
)
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.model_errors import fixed_axes
from kinertia.estimation.simultaneous.uncertainty.moment_derivatives import MomentsOfTrial

_USUAL_SD = 0.02
"""Standard deviation of each share where nothing is missing: on fault-free walks the thirds of a contact differ by up
to 0.03, and the vertical share is up to 0.06, from skin and model."""
_GAIN_SD = 0.15
"""Standard deviation of the gain either way: not its size is evidence, only whether it is the same throughout."""
SURE = 2.0
"""Log odds from which a load is missing: -12 to -2 on walks without a fault and with gain errors of 10 and 20 %; 8 with
15 % of the load missing late in stance, 3 to 15 with 12 % of body weight on a stick."""
_LEAST = 0.07
"""Share of the load from which it counts as missing: beside a plate of which 30 % are missing, 2 to 6 % of another's
seem to be."""
_MOST_FRAMES = 100
"""Number of frames of each trial, evenly spaced, at which moments are compared."""
_ROOT = 6
"""Coordinates of the pelvis come first: their generalised forces are residuals, not joint moments."""
_WRONG_ODDS = 0.25
"""Prior odds of a wrong to a right sign: two of some ten laboratories had it wrong."""
_SURE = float(np.log(0.95 / 0.05))
"""Log odds at which a sign counts as established: a probability of 95 %."""


@dataclass(frozen=True)
class MissingLoad:
    """A load of which part is missing.

    Attributes:
        trial, plate: names.
        span_s: first and last time (s) of the part of a contact in which most is missing.
        missing, sd: share of the load that is missing there, and its standard deviation.
        log_odds: logarithm of how much likelier it is than errors of the plate.
    """

    trial: str
    plate: str
    span_s: tuple[float, float]
    missing: float
    sd: float
    log_odds: float


@dataclass(frozen=True, eq=False)
class _Shown:
    """Information of the data on all instruments and the missing shares, at the optimum without missing loads.

    Attributes:
        problem: with the shares of missing loads among its errors.
        data, rhs: (k, k) and (k,) information and right-hand side, without priors.
    """

    problem: MapProblem
    data: np.ndarray
    rhs: np.ndarray

    def under(self, suspected: Sequence[str], incomplete: Collection[int]) -> ErrorPriors:
        """Return the priors with gain errors of unknown size of suspected plates, and loads that are missing on others.

        `incomplete` are the indices of the latter.
        """
        layout, given = self.problem.layout, self.problem.given
        instruments, parts = self.problem.term(InstrumentErrors), self.problem.term(MissingLoads).parts
        individual, first = list(layout.error_priors.individual), layout.errors.start
        for k, trial in enumerate(given.trials):
            for name, at in zip(trial.ground.plates, instruments.gains_of(k), strict=True):
                if name in suspected:
                    individual[at - first] = FaultMixture.certain(_GAIN_SD)
        for at, part in enumerate(parts, layout[MISSING].start - first):
            individual[at] = FaultMixture.certain(MISSING_SD if part.plate in incomplete else _USUAL_SD)
        return ErrorPriors(tuple(individual), layout.error_priors.common)

    def log_evidence(self, priors: ErrorPriors) -> float:
        """Return the logarithm of the evidence under these priors, up to what all have in common."""
        nothing = log_chance(priors, np.zeros_like(self.data), np.zeros_like(self.rhs))
        return log_chance(priors, self.data, self.rhs) - nothing

    def most_missing(self, priors: ErrorPriors, plate: int) -> tuple[LoadPart, float, float] | None:
        """Return the part of the plate's contacts in which most is missing, its share and SD; None if little."""
        gaussian = GaussianPrior.given(priors, self.data, self.rhs)
        covariance = np.linalg.inv(self.data + gaussian.precision)
        mean = covariance @ (self.rhs + gaussian.pull)
        found = []
        for part, sums in self._sums(plate):
            factor = 1.0 + float(sums @ mean)
            found.append((part, 1.0 - 1.0 / factor, float(np.sqrt(sums @ covariance @ sums)) / factor**2))
        most = max(found, key=lambda missing: missing[1], default=None)
        return most if most is not None and most[1] > _LEAST else None

    def _sums(self, plate: int) -> list[tuple[LoadPart, np.ndarray]]:
        """Return the thirds of a plate's contacts with the sum (k,) of errors that is the factor of their load."""
        layout, instruments = self.problem.layout, self.problem.term(InstrumentErrors)
        parts, first, result = self.problem.term(MissingLoads).parts, layout.errors.start, []
        for index, part in enumerate(parts):
            if part.plate != plate or part.vertical:
                continue
            sums, start = np.zeros(len(self.rhs)), layout[MISSING].start - first
            sums[start + index] = 1.0
            for other, whole in enumerate(parts):
                same = (whole.trial, whole.foot, whole.plate) == (part.trial, part.foot, part.plate)
                if whole.vertical and same and (whole.frames & part.frames).any():
                    sums[start + other] = 1.0
            column = self.problem.given.trials[part.trial].ground.plates.index(self.problem.given.plates[plate])
            sums[instruments.gains_of(part.trial)[column] - first] = 1.0
            result.append((part, sums))
        return result


def suspected_plates(errors: Sequence[CalibrationEntry]) -> list[str]:
    """Return the names of plates whose errors of gain or position were found: loads may be missing there."""
    suspected = (error.plate for error in errors if error.quantity in (GAIN, POSITION) and error.found)
    return list(dict.fromkeys(name for name in suspected if name is not None))


def missing_loads(problem: MapProblem, point: Point, plates: Sequence[str]) -> tuple[MissingLoad, ...]:
    """Find plates of whose loads a part is missing: first the likeliest, then those that are likely besides.

    Args:
        problem: of the estimate.
        point: its optimum, without missing loads.
        plates: names of those that seem to have errors; without any, nothing is tested.
    """
    if not plates or problem.calibration.instruments.incomplete:
        return ()
    shown, found, incomplete = _shown(problem, point), [], set[int]()
    given = shown.problem.given
    known = shown.log_evidence(shown.under(plates, incomplete))
    while rest := set(range(len(given.plates))) - incomplete:
        likely = {plate: shown.log_evidence(shown.under(plates, {*incomplete, plate})) for plate in rest}
        plate = max(likely, key=likely.__getitem__)
        log_odds, known = likely[plate] - known, likely[plate]
        if log_odds < SURE:
            break
        incomplete.add(plate)
        found.append((plate, log_odds))
    priors, result = shown.under(plates, incomplete), []
    for plate, log_odds in found:
        most = shown.most_missing(priors, plate)
        if most is not None:
            part, missing, sd = most
            trial, time = given.trials[part.trial], given.trials[part.trial].time[part.frames]
            span_s = float(time[0]), float(time[-1])
            result.append(MissingLoad(trial.name, given.plates[plate], span_s, missing, sd, log_odds))
    return tuple(result)


def _shown(problem: MapProblem, point: Point) -> _Shown:
    """Return what the data show at the optimum, with missing loads of all plates."""
    known = replace(problem.calibration.instruments, incomplete=frozenset(problem.given.plates))
    calibration, kinds = replace(problem.calibration, instruments=known), [type(term) for term in problem.terms]
    other = MapProblem(
        problem.skeleton, problem.prior, calibration, problem.trials, problem.given.phase, kinds, problem.precise
    )
    static = np.zeros(other.layout.size)
    for name, at in problem.layout.places.items():
        if at.stop - at.start == other.layout[name].stop - other.layout[name].start:
            static[other.layout[name]] = point.static[at]
    point = replace(point, static=static)
    here, gaussian = other.at(point), GaussianPrior.of(other.layout.error_priors)
    model = GaussNewton.of(other, here, other.second_derivatives(point.like(here.slope.rhs).static)).under(gaussian)
    mean, covariance = model.of_instruments(point, model.step(here.slope.under(gaussian)[1]))
    after = np.linalg.inv(covariance)
    return _Shown(other, after - gaussian.precision, after @ mean - gaussian.pull)


@dataclass(frozen=True, eq=False)
class InstrumentSupport:
    """Support of the k instrument unknowns, in the order of `Layout.errors`.

    Attributes:
        moved: (k,) effect of a unit of the uncorrected error on the most affected joint moment, in half-widths of the
            moment's own 95 % interval.
        contradicted: (k,) whether a single trial and the others disagree; False for errors that belong to one trial.
    """

    moved: np.ndarray
    contradicted: np.ndarray


def instrument_support(
    model: GaussNewton, point: Point, gaussian: GaussianPrior, curves: tuple[CurveDeviations, ...]
) -> InstrumentSupport:
    """Compute the support of all instruments' errors.

    Args:
        model: the quadratic at the end of the search, under the Gaussian.
        point: the estimate.
        gaussian: replaces the priors of the instruments.
        curves: standard deviations of the trials' curves.
    """
    root, late = model.static.root_of_covariance(), model.problem.loads.delay_unknowns
    delay_sd_s = [float(np.linalg.norm(root[late(k)].sum(axis=0))) for k in range(len(curves))]
    each_trial = enumerate(zip(curves, delay_sd_s, strict=True))
    moved = [moved_moments(model.problem, k, point, *in_trial) for k, in_trial in each_trial]
    return InstrumentSupport(np.max(moved, axis=0), contradicted_errors(model, gaussian))


def moved_moments(
    problem: MapProblem, k: int, point: Point, curves: CurveDeviations, delay_sd_s: float = 0.0
) -> np.ndarray:
    """Compute `InstrumentSupport.moved` (k,) in one trial, from derivatives of its joint moments at fixed motion.

    The derivatives by the delay are averaged over its standard deviation. Axes that may be tilted make moments about
    them less certain, but the laboratory's errors no smaller: intervals here are without them.
    """
    dynamic, instruments = np.flatnonzero(problem.trials[k].dynamic), problem.layout.errors
    if not len(dynamic):
        return np.zeros(instruments.stop - instruments.start)
    some = np.unique(np.linspace(0, len(dynamic) - 1, min(_MOST_FRAMES, len(dynamic))).astype(int))
    frames, static = dynamic[some], problem.in_trial(k, point)
    motion = problem.model.full(problem.bases[k].evaluate(point.coefficients[k], frames), static)
    every = MomentsOfTrial(problem, k, static, problem.loads.reactions(k, static), delay_sd_s)
    by = every.derivatives(motion, frames)
    change = np.abs(by.static[:, _ROOT : len(problem.moving), instruments])
    rows = np.searchsorted(problem.trials[k].curve_frames, frames)
    about, of_joints = by.value[:, : len(problem.moving)], by.value[:, len(problem.moving) :]
    axes = fixed_axes(problem.skeleton, every.virtual.joints, of_joints, about, problem.calibration.fixed_axes)
    sd = np.sqrt(np.square(curves.moments[rows]) - axes)[:, _ROOT:, None]
    result: np.ndarray = (change / (INTERVAL_SD * sd)).max(axis=(0, 1))
    return result


def contradicted_errors(model: GaussNewton, gaussian: GaussianPrior) -> np.ndarray:
    """Return the mask (k,) of the laboratory's instruments for which one trial and all the others disagree.

    Each estimate includes the priors; they disagree beyond 95 % for any of the trials.
    """
    problem, here = model.problem, model.here
    layout, count = problem.layout, len(here.trials)
    result = np.zeros(len(gaussian.pull), dtype=bool)
    if count < 2:
        return result
    right_hand_sides = _right_hand_sides(model)
    prior_rhs = here.point.like(here.slope.under(gaussian)[1]).static
    prior_rhs = prior_rhs - sum(trial.gradient.static_rhs for trial in here.trials)
    prior = here.information.copy()
    prior[layout.errors, layout.errors] += gaussian.precision
    every = sum(of_trial.information for of_trial in model.displaced)
    shared = slice(0, layout.laboratory.stop - layout.laboratory.start)
    # by chance one of twenty instruments, however many trials there are; with two, each contradicts the other
    apart_sd = -ndtri(0.025 / (count if count > 2 else 1))
    for k, displaced in enumerate(model.displaced):
        alone = _posterior(
            prior + displaced.information, prior_rhs + right_hand_sides[k], layout.in_root.stop, layout.errors
        )
        rest = prior_rhs + sum(right_hand_sides) - right_hand_sides[k]
        others = _posterior(prior + every - displaced.information, rest, layout.in_root.stop, layout.errors)
        apart = np.abs(alone[0] - others[0]) > apart_sd * np.hypot(alone[1], others[1])
        result[shared] |= apart[shared]
    return result


def _right_hand_sides(model: GaussNewton) -> list[np.ndarray]:
    """Return, per trial, the right-hand side (S,) on the static unknowns, motion and displacements eliminated."""
    pull, places = model.here.point.like(model.here.slope.rhs), model.problem.layout.displaced
    result = []
    for k, (trial, displaced) in enumerate(zip(model.here.trials, model.displaced, strict=True)):
        _, lost = trial.forward(pull.coefficients[k])
        pulled = pull.displaced[k] - model.problem.displaced_sd[k] * lost[places]
        result.append(trial.gradient.static_rhs - lost - pulled @ displaced.gain)
    return result


def _posterior(information: np.ndarray, rhs: np.ndarray, first: int, places: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return steps (k,) of the unknowns at these indices, and their standard deviations (k,)."""
    found = StaticInformation.of(information, first)
    covariance = np.linalg.inv(found.first)
    variance = np.maximum(np.diag(covariance)[places], 0.0)
    return found.solution(rhs)[places], np.sqrt(variance)


class Evidence(NamedTuple):
    """Logarithms of the evidence, up to a constant common to all interpretations of the same trials.

    Attributes:
        found: of the trials as they were estimated.
        otherwise: of the same trials interpreted differently, by the same quadratic; None if not requested.
    """

    found: float
    otherwise: float | None

    @classmethod
    def of(cls, model: GaussNewton, gaussian: GaussianPrior, otherwise: Sequence[Observation]) -> Self:
        """Compute the evidence of the trials of a quadratic at the optimum, as they are and interpreted differently.

        The Gaussian replaces the instruments' priors.
        """
        problem = model.problem
        found = log_evidence(model.here.slope, model, gaussian)
        if not otherwise:
            return cls(found, None)
        other = problem.of(otherwise)
        return cls(found, log_evidence(other.slope(model.here.point), model, gaussian))


def log_evidence(slope: Slope, model: GaussNewton, gaussian: GaussianPrior) -> float:
    """Compute the logarithm of the evidence of one interpretation.

    Args:
        slope: of this interpretation, at a point near the optimum.
        model: the quadratic there, under the Gaussian.
        gaussian: replaces the priors of the instruments.
    """
    cost, rhs = slope.under(gaussian)
    step = model.step(rhs)
    mean, covariance = model.of_instruments(slope.point, step)
    after = np.linalg.inv(covariance)
    data, pulled = after - gaussian.precision, after @ mean - gaussian.pull
    # lowest cost of all else, with the instruments as at the optimum
    lowest = cost - 0.5 * float(rhs @ step) - gaussian.cost(mean)
    at_none = lowest - 0.5 * float(mean @ data @ mean) + float(pulled @ mean)
    return log_chance(model.problem.layout.error_priors, data, pulled) - at_none


@dataclass(frozen=True)
class FreeMomentSign:
    """Evidence of a person's trials on the sign of the free moments.

    Attributes:
        log_odds: logarithm of how much likelier the trials are with the sign reversed.
        rms_nm: of the free moments, N m.

    >>> FreeMomentSign(59.0, 2.0).wrong, FreeMomentSign(1.0, 2.0).open, FreeMomentSign(-20.0, 2.0).open
    (True, True, False)
    """

    log_odds: float
    rms_nm: float

    @property
    def _posterior(self) -> float:
        return self.log_odds + float(np.log(_WRONG_ODDS))

    @property
    def wrong(self) -> bool:
        """Whether the sign is wrong in the files."""
        return self._posterior > _SURE

    @property
    def open(self) -> bool:
        """Whether these trials leave the sign undetermined."""
        return abs(self._posterior) <= _SURE
