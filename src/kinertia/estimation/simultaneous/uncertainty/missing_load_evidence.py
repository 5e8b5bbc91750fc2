"""Tests whether part of a plate's load is missing in some contact, which otherwise seems to be an error of the plate.

A gain multiplies all of a plate's load: in every contact, in every phase of stance, horizontal and vertical alike.
Where the load is missing in one phase only, or only vertically, no gain corrects both. The quadratic at the optimum,
with the shares of `missing_loads` added, gives the evidence for either.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.simultaneous.calibration_entry import GAIN, POSITION, CalibrationEntry
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture, GaussianPrior, log_chance
from kinertia.estimation.simultaneous.search.gauss_newton import GaussNewton
from kinertia.estimation.simultaneous.search.linearised import Point
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.terms.instrument_term import InstrumentErrors
from kinertia.estimation.simultaneous.terms.missing_loads import MISSING, MISSING_SD, LoadPart, MissingLoads

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
        own, first = list(layout.error_priors.own), layout.errors.start
        for k, trial in enumerate(given.trials):
            for name, at in zip(trial.ground.plates, instruments.gains_of(k), strict=True):
                if name in suspected:
                    own[at - first] = FaultMixture.certain(_GAIN_SD)
        for at, part in enumerate(parts, layout[MISSING].start - first):
            own[at] = FaultMixture.certain(MISSING_SD if part.plate in incomplete else _USUAL_SD)
        return ErrorPriors(tuple(own), layout.error_priors.common)

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
        most = max(found, key=lambda one: one[1], default=None)
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
            own = self.problem.given.trials[part.trial].ground.plates.index(self.problem.given.plates[plate])
            sums[instruments.gains_of(part.trial)[own] - first] = 1.0
            result.append((part, sums))
        return result


def suspected_plates(errors: Sequence[CalibrationEntry]) -> list[str]:
    """Return the names of plates whose errors of gain or position were found: loads may be missing there."""
    suspected = (one.plate for one in errors if one.quantity in (GAIN, POSITION) and one.found)
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
    model = GaussNewton.of(other, here, other.bends(point.like(here.slope.rhs).static)).under(gaussian)
    mean, covariance = model.of_instruments(point, model.step(here.slope.under(gaussian)[1]))
    after = np.linalg.inv(covariance)
    return _Shown(other, after - gaussian.precision, after @ mean - gaussian.pull)
