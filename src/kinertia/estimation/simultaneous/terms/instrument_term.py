"""Adds errors of force plates and synchronisation, and loads missing from a plate in part of a contact.

Plates are levelled, and the cameras' frame is laid on the floor, each to about 0.1 degrees. A tilt of 0.14 degrees
turns 0.24 % of the vertical force into a horizontal one: 1.5 N under a person of 60 kg. In one trial this cannot be
distinguished from a zero offset; in the next, in which the plates bear other loads, it looks like another zero offset.
It is part of the uncertainty of zero offsets from one trial.

A forefoot beyond the edge takes load off the plate once the heel is lifted; a stick or a handrail takes vertical force.
Each contact has a share of the vertical load, and each third of it a share of the whole load, that is missing. They are
unknowns for plates whose loads the prior calls incomplete; the loads on the feet, for joint moments, stay as measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from kinertia.estimation.simultaneous.inputs import FreedModel, Given, Unknowns
from kinertia.estimation.simultaneous.instruments.instrument_errors import FoundErrors, instrument_errors
from kinertia.estimation.simultaneous.instruments.plates import GAIN, PLATE_ERRORS, ZERO_UNKNOWNS, plates_with_floor
from kinertia.estimation.simultaneous.instruments.priors import SOFT_TISSUE_LAG_S, InstrumentInformation
from kinertia.estimation.simultaneous.mixture_prior import ErrorPriors, FaultMixture, fault_probabilities
from kinertia.estimation.simultaneous.observation import Observation
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm, LoadTerm, Solution
from kinertia.estimation.simultaneous.terms.root_terms import RootFrames
from kinertia.trial.sampled_data import runs

PLATES, CLOCK, TRIAL_DELAYS, ZEROS, GAINS = "plates", "clock", "delays", "zeros", "gains"
TILT_SD_RAD = float(np.radians(0.14))
"""Standard deviation of the tilt about each horizontal axis: two instruments, each level to 0.1 degrees."""
MISSING = "missing loads"
MISSING_SD = 0.12
"""Standard deviation of each share."""
_LOADED, _FEWEST, _PARTS = 0.1, 4, 3
"""Share of a foot's largest load from which it is a contact; fewest frames of a part; number of parts."""


class InstrumentErrors(LoadTerm):
    """Errors of plates and synchronisation.

    PLATES has PLATE_UNKNOWNS of each plate, then FLOOR_UNKNOWNS. Each of several trials has a delay of its own besides
    the synchronisation delay, and so has a single trial whose synchronisation was not checked. Zero offsets
    (ZERO_UNKNOWNS) and gains belong to each trial's plates; the gains add to those of all trials.
    """

    order: ClassVar[int] = 20

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return all errors, each with a prior of being fault-free or faulty."""
        known, trials = given.calibration.instruments, given.trials
        shared = known.of_unknowns(given.plates)
        # one trial of a session is one of several, and so may be one whose synchronisation nobody has checked
        count = sum(bool(trial.ground.plates) for trial in trials)
        delay_unknowns = count > 1 or known.session or known.delay_s.fault_probability > 0.0
        plates = sum(len(trial.ground.plates) for trial in trials)
        gains = tuple(known.trial_gain_of(name) for trial in trials for name in trial.ground.plates)

        def of_trials(prior: FaultMixture, count: int) -> ErrorPriors:
            return ErrorPriors((prior,) * count)

        return (
            Unknowns.errors(
                PLATES, "m, 1, N m/N or rad", ErrorPriors(shared.individual[:-1], shared.common), of_laboratory=True
            ),
            Unknowns.errors(CLOCK, "s", ErrorPriors(shared.individual[-1:]), of_laboratory=True),
            Unknowns.errors(TRIAL_DELAYS, "s", of_trials(known.trial_delay_s, count if delay_unknowns else 0)),
            Unknowns.errors(ZEROS, "N", of_trials(known.zero_offset_n, len(ZERO_UNKNOWNS) * plates)),
            Unknowns.errors(GAINS, "1", ErrorPriors(gains)),
        )

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        given = self.given
        self._own = [[given.plates.index(name) for name in trial.ground.plates] for trial in given.trials]
        self._to_plates = plates_with_floor(len(given.plates))
        self._session = given.calibration.instruments.of_session(given.plates)
        self._known = given.calibration.instruments.beside_root(given.plates)

    def add_information(self, into: np.ndarray, static: np.ndarray) -> None:
        """Add the information from other people of the session, and from the person's feet."""
        at = self.layout.laboratory
        into[at, at] += self._known.information

    def add_pull(self, rhs: np.ndarray, static: np.ndarray) -> float:
        """Add the right-hand side of the same, and return the change in twice the cost."""
        errors, shown = static[self.layout.laboratory], self._known
        pull = shown.information @ errors
        rhs[self.layout.laboratory] += shown.rhs - pull
        return float(errors @ (pull - 2.0 * shown.rhs))

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """Return the zero offsets that a tilt about each horizontal axis imitates (`mean_loads_n`)."""
        result = np.zeros((len(static), len(ZERO_UNKNOWNS)))
        for k, trial in enumerate(self.given.trials):
            for axis, places in enumerate(self.zeros_of(k).T):
                result[places, axis] = TILT_SD_RAD * mean_loads_n(trial)
        return result

    def delay_unknowns(self, k: int) -> list[int]:
        """Return the indices of the synchronisation delay and of the trial's own delay."""
        delays = self.layout[TRIAL_DELAYS]
        return [self.layout[CLOCK].start, *range(delays.start, delays.stop)[k : k + 1]]

    def profiled(self) -> list[int]:
        """Return the delays of a single trial with forces, if it is undetermined whether they are delayed."""
        places, priors = self.delay_unknowns(0), self.layout.error_priors.individual
        mixtures = [priors[at - self.layout.errors.start] for at in places]
        uncertain = any(0.0 < prior.fault_probability < 1.0 for prior in mixtures)
        return places if uncertain and sum(map(bool, self._own)) < 2 else []

    def imitated(self) -> tuple[float, float]:
        """Return what soft tissue lags, unless other people of the session show the delay."""
        return (0.0, 0.0) if self._session.information[-1, -1] > 0.0 else SOFT_TISSUE_LAG_S

    def corrected_loads(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray
    ) -> np.ndarray:
        """Correct loads for all errors but delays."""
        return self.given.grounds[k].corrected_loads(loads, loaded, plate_index, self.plates_in(k, static))

    def by_unknowns(
        self, k: int, static: np.ndarray, loads: np.ndarray, loaded: np.ndarray, plate_index: np.ndarray
    ) -> np.ndarray:
        """Return derivatives (n, 2, 6, p, 7) by the errors of the plates in trial k."""
        return self.given.grounds[k].by_plate(loads, loaded, plate_index, self.plates_in(k, static))

    def add_by_unknowns(self, k: int, by_static: np.ndarray, by: np.ndarray) -> None:
        """Add derivatives (n, r, p, 7) by the errors of the plates in trial k."""
        n, rows, *_ = by.shape
        errors = len(PLATE_ERRORS)
        by_static[:, :, self.layout[PLATES]] += by[..., :errors].reshape(n, rows, -1) @ self._to_plates
        by_static[:, :, self.zeros_of(k)] += by[:, :, self._own[k], errors:]
        by_static[:, :, self.gains_of(k)] += by[:, :, self._own[k], GAIN]

    def plates_in(self, k: int, static: np.ndarray) -> np.ndarray:
        """Return PLATE_ERRORS and ZERO_UNKNOWNS (..., p, 7) of every plate in trial k, from unknowns (..., S)."""
        kinds, plates = static.shape[:-1], len(self.given.plates)
        zeros = np.zeros((*kinds, plates, len(ZERO_UNKNOWNS)))
        errors = (static[..., self.layout[PLATES]] @ self._to_plates.T).reshape(*kinds, plates, len(PLATE_ERRORS))
        errors[..., self._own[k], GAIN] += static[..., self.gains_of(k)]
        zeros[..., self._own[k], :] = static[..., self.zeros_of(k)]
        return np.concatenate([errors, zeros], axis=-1)

    def zeros_of(self, k: int) -> np.ndarray:
        """Return the indices (q, 2) of the zero offsets of the q plates of trial k."""
        return self._of_trial(k, ZEROS, len(ZERO_UNKNOWNS)).reshape(-1, len(ZERO_UNKNOWNS))

    def gains_of(self, k: int) -> np.ndarray:
        """Return the indices (q,) of the trial-specific gains of the q plates of trial k."""
        return self._of_trial(k, GAINS, 1)

    def _of_trial(self, k: int, name: str, per_trial: int) -> np.ndarray:
        first = self.layout[name].start + per_trial * sum(map(len, self._own[:k]))
        return np.arange(first, first + per_trial * len(self._own[k]))

    def read(self, solution: Solution) -> dict[str, Any]:
        """Return an entry of each error with standard deviation and support, and the information for the session."""
        trials, plates, values, sd = self.given.trials, self.given.plates, solution.static, solution.sd
        covariance = solution.covariance[self.layout[PLATES], self.layout[PLATES]]
        shape = len(plates), len(PLATE_ERRORS)
        shared = (self._to_plates @ values[self.layout[PLATES]]).reshape(shape)
        shared_sd = np.sqrt(np.diag(self._to_plates @ covariance @ self._to_plates.T)).reshape(shape)
        zeros = [(trial.ground.plates, self.zeros_of(k)) for k, trial in enumerate(trials)]
        found = FoundErrors(
            plates=dict(zip(plates, zip(shared, shared_sd, strict=True), strict=True)),
            delay_s=solution.pairs(self.layout[CLOCK])[0],
            delays_s=self._delays(solution),
            zeros_n=tuple(dict(zip(names, zip(values[at], sd[at], strict=True), strict=True)) for names, at in zeros),
            gains=tuple(self._gains(k, solution) for k in range(len(trials))),
            instruments=self._shown(solution),
        )
        first = self.layout.errors.start
        entries = instrument_errors(
            found,
            self.given.calibration.instruments,
            [trial.name for trial in trials],
            (solution.moved, solution.contradicted),
            self.layout[TRIAL_DELAYS].start - first,
        )
        return {"calibration": entries, "instruments": found.instruments}

    def _delays(self, solution: Solution) -> tuple[tuple[float, float], ...]:
        """Return the additional delays of several trials, or a single trial's total, with standard deviations, s."""
        delays = solution.pairs(self.layout[TRIAL_DELAYS])
        if len(delays) != 1:
            return tuple(delays)
        both = self.delay_unknowns(0)
        return ((float(solution.static[both].sum()), float(np.sqrt(solution.covariance[np.ix_(both, both)].sum()))),)

    def _gains(self, k: int, solution: Solution) -> dict[str, tuple[float, float]]:
        """Return the total gain errors of a trial's plates, and their standard deviations."""
        result = {}
        for plate, at in zip(self.given.trials[k].ground.plates, self.gains_of(k), strict=True):
            sums = np.zeros(self.layout.size)
            sums[self.layout[PLATES]] = self._to_plates[len(PLATE_ERRORS) * self.given.plates.index(plate) + GAIN]
            sums[at] = 1.0
            result[plate] = float(sums @ solution.static), float(np.sqrt(sums @ solution.covariance @ sums))
        return result

    def _shown(self, solution: Solution) -> InstrumentInformation:
        """Return the information of the trials on the laboratory's instruments, without prior knowledge.

        What is each trial's own is eliminated with its prior's standard deviation. The Gaussian that replaces priors
        in the estimate is of all errors together, and its part for these alone says too little: single walks then
        seemed to know of gains of 5 %. Several trials show which of them has a fault of its own.
        """
        prior, session, every = solution.gaussian, self._session, self.layout.errors
        mean, covariance = solution.static[every], solution.covariance[every, every]
        size, priors = len(session.rhs), self.layout.error_priors
        more = (0, len(mean) - size)
        before = ((prior.precision, prior.pull), (np.pad(session.information, more), np.pad(session.rhs, more)))
        shown = InstrumentInformation.of_posterior(self.given.plates, mean, covariance, before)
        individual = priors.individual[size:]
        if len(self.given.trials) > 1:
            faulty = fault_probabilities(priors, shown.information, shown.rhs)[size:].tolist()
            individual = tuple(
                replace(prior_of_error, fault_probability=share)
                for prior_of_error, share in zip(individual, faulty, strict=True)
            )
        return shown.without_own(np.array([prior_of_error.sd for prior_of_error in individual]))


def mean_loads_n(trial: Observation) -> np.ndarray:
    """Return the mean vertical force (p,) on each of the trial's plates, while it is loaded."""
    if not trial.ground.plates:
        return np.zeros(0)
    frames = np.flatnonzero(trial.dynamic)
    vertical = trial.ground.loads(trial.time[frames]).reshape(-1, 2, 6)[..., 1]
    stood = trial.ground.loaded(trial.time[frames]).reshape(-1, 2)
    result = np.zeros(len(trial.ground.plates))
    for plate in range(len(result)):
        share = np.where(trial.ground.plate_index[frames] == plate, np.clip(stood, 0.0, 1.0), 0.0)
        result[plate] = (share * vertical).sum() / max(share.sum(), 1.0)
    return result


@dataclass(frozen=True, eq=False)
class LoadPart:
    """Part of a contact: trial, foot, index of the plate, frames (n,) of the trial; of vertical loads only, or all."""

    trial: int
    foot: int
    plate: int
    frames: np.ndarray
    vertical: bool

    def of(self, loads: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return this part (d, 6) of loads on the feet (d, 2, 6) at these frames (d,)."""
        result: np.ndarray = loads[:, self.foot] * self.frames[frames][:, None]
        if self.vertical:
            # of the moments about the ground origin, those about horizontal axes are the vertical force's
            result = result * [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]
        return result


def _parts(given: Given) -> Iterator[LoadPart]:
    """Yield the parts of all contacts of plates with incomplete loads."""
    incomplete = [k for k, name in enumerate(given.plates) if name in given.calibration.instruments.incomplete]
    for k, (trial, ground) in enumerate(zip(given.trials, given.grounds, strict=True)):
        if not incomplete or not trial.ground.plates:
            continue
        vertical = ground.loads(trial.time).reshape(-1, 2, 6)[..., 1]
        for foot, load in enumerate(vertical.T):
            for plate in incomplete:
                on = (load > _LOADED * load.max()) & (ground.plate_index[:, foot] == plate)
                for first, last in runs(on):
                    yield from _of_contact(k, foot, plate, trial.dynamic, np.arange(first, last + 1))


def _of_contact(k: int, foot: int, plate: int, dynamic: np.ndarray, contact: np.ndarray) -> Iterator[LoadPart]:
    """Yield the vertical load of a contact, and its thirds; only parts of which enough frames are measured."""
    thirds = ((some, False) for some in np.array_split(contact, _PARTS))
    for some, vertical in ((contact, True), *thirds):
        frames = np.zeros(len(dynamic), dtype=bool)
        frames[some] = dynamic[some]
        if frames.sum() >= _FEWEST:
            yield LoadPart(k, foot, plate, frames, vertical)


class MissingLoads(CostTerm):
    """Loads that act on the body but not on plates with incomplete loads, as shares of what the plates measured."""

    order: ClassVar[int] = 30

    @classmethod
    def unknowns(cls, given: Given) -> tuple[Unknowns, ...]:
        """Return the share of each part; none if all loads are complete."""
        prior = FaultMixture.certain(MISSING_SD)
        return (Unknowns.errors(MISSING, "1", ErrorPriors((prior,) * len(list(_parts(given))))),)

    def __init__(self, model: FreedModel) -> None:
        super().__init__(model)
        self.parts = list(_parts(self.given))

    def in_root(self, root: RootFrames, k: int, static: np.ndarray) -> RootFrames:
        """Add the missing loads of trial k."""
        parts = [index for index, part in enumerate(self.parts) if part.trial == k]
        if not parts:
            return root
        loads = self.given.grounds[k].loads(self.given.trials[k].time[root.frames]).reshape(-1, 2, 6)
        by = np.stack([self.parts[index].of(loads, root.frames) for index in parts], axis=2)
        at = self.layout[MISSING].start + np.array(parts)

        def add(by_static: np.ndarray, by: np.ndarray) -> None:
            by_static[:, :, at] += by

        return replace(root, wrench=root.wrench + by @ static[at], by_errors=(*root.by_errors, (by, add)))
