"""Draws people from the literature's prior, simulates the measurement of their walks, and estimates them.

A draw depends on seed, scenario and its number only; people of one number are the same in every scenario.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.simultaneous.fit import calibration_prior
from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.bandwidth import Bandwidth
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.observation import Observations, observe
from kinertia.estimation.simultaneous.observed_trial import CalibrationPrior
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.synthetic.faults import Faults, measured
from kinertia.synthetic.motions import MOTIONS
from kinertia.synthetic.walk import SyntheticSubject, SyntheticTrial, walk, walking_subject

WALK_S = 2.5
_HELD_SD_M = 1e-4


@dataclass(frozen=True)
class Scenario:
    """One kind of laboratory and its recordings.

    Its faults, whether the estimator calibrates, the duration of the recorded walk, and other recorded motions
    (`kinertia.synthetic.motions.MOTIONS`).
    """

    title: str
    faults: Faults
    calibrated: bool = True
    walk_s: float = WALK_S
    others: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class EstimatedPerson:
    """One person, measured once.

    Attributes:
        person: the truth.
        prior: the literature's.
        trials: true trials of the person.
        skeleton, recorded: the laboratory's skeleton and recordings.
        calibration: prior of skeleton and instruments in the estimate.
        seen: observations that the estimate is made from.
        result: the estimate.
        rng: random generator of the person's noise, after its use by the laboratory.
    """

    person: SyntheticSubject
    prior: BspPrior
    trials: Sequence[SyntheticTrial]
    skeleton: Skeleton
    recorded: Sequence[Kinematics]
    calibration: CalibrationPrior
    seen: Observations
    result: SimultaneousResult
    rng: np.random.Generator

    @property
    def errors(self) -> np.ndarray:
        """Estimate minus truth (s, 10), in the order and units of `BodySegmentParameters.table`."""
        return self.result.bsp.table() - self.person.bsp.table()

    @property
    def literature_errors(self) -> np.ndarray:
        """Literature minus truth (s, 10)."""
        return self.prior.mean.table() - self.person.bsp.table()


def estimate_person(seed: int, case: tuple[Scenario, int]) -> EstimatedPerson:
    """Draw, measure and estimate the person of this number."""
    scenario, number = case
    of_person, of_noise = (np.random.default_rng(s) for s in np.random.SeedSequence(seed, spawn_key=(number,)).spawn(2))
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    person = replace(subject, bsp=prior.draw(of_person))
    trials = [walk(person, scenario.walk_s, trapezoid=False), *(MOTIONS[name](person) for name in scenario.others)]
    skeleton, recorded = measured(trials, scenario.faults, of_noise)
    seen = observe(skeleton, recorded, prior.mass_kg, Bandwidth.of(recorded))
    calibration = calibration_prior(skeleton) if scenario.calibrated else held(skeleton)
    result = estimate_simultaneous(skeleton, prior, calibration, seen.pooled)
    return EstimatedPerson(person, prior, trials, skeleton, recorded, calibration, seen, result, of_noise)


def held(skeleton: Skeleton) -> CalibrationPrior:
    """Return the prior without calibration: skeleton and instruments count as exact."""
    places = np.full(len(skeleton.markers), _HELD_SD_M)
    exact = FaultMixture.certain(_HELD_SD_M)
    plate, floor = (dict.fromkeys(names, exact) for names in (PLATE_UNKNOWNS, FLOOR_UNKNOWNS))
    return CalibrationPrior({}, places, InstrumentPrior(plate, floor, exact, exact, exact, trial_gain=exact))
