"""Finds the body segment parameters that are not highly sensitive to noisy kinematics: the study's open question.

People drawn from the literature's prior walk and are estimated (`estimate_person`), with one thing changed at a
time: amplitude and kind of the noise, number of strides, additional squats. The RMS error over people of each parameter
is reported as a share of the literature's on the same people.

A draw depends on seed, scenario and its number only; people of one number are the same in every scenario.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.simultaneous.fit import calibration_prior
from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY, InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.mixture_prior import FaultMixture
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observations, observe
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.model.bsp import PARAMETERS
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.studies.parallel import in_parallel
from kinertia.synthetic.motions import MOTIONS, Faults, measured
from kinertia.synthetic.walk import SyntheticSubject, SyntheticTrial, walk, walking_subject

AMPLITUDES = (0.25, 0.5, 1.0, 2.0)
STRIDES = (1, 2, 4, 8)
STRIDE_S = 1.25
KINDS = {"study": "the study's noise", "artefact": "skin motion"}
WITH_SQUATS = "2 strides and 2 squats"
WALK_S = 2.5


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


CONDITIONS = {
    **{
        f"{kind} x {amplitude:g}": Scenario(f"{title} x {amplitude:g}", Faults(kind, amplitude))  # type: ignore[arg-type]
        for kind, title in KINDS.items()
        for amplitude in AMPLITUDES
    },
    **{
        f"strides {count}": Scenario(f"skin motion, strides: {count}", Faults("artefact"), walk_s=count * STRIDE_S)
        for count in STRIDES
        if count * STRIDE_S != Scenario("", Faults("artefact")).walk_s
    },
    WITH_SQUATS: Scenario("skin motion, two strides and two squats", Faults("artefact"), others=("squat",)),
}
"""Conditions, with two strides (2.5 s) unless stated otherwise."""
SHOWN = PARAMETERS[:7]
INSENSITIVE = 0.5
"""Share of the literature's error below which an error counts as small."""
_HELD_SD_M = 1e-4
UNCERTAINTY = GAIT27_UNCERTAINTY.with_fixed_axes()
"""As in fits, which do not estimate axes unless they are asked to."""


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
    calibration = calibration_prior(skeleton, UNCERTAINTY) if scenario.calibrated else held(skeleton)
    result = estimate_simultaneous(skeleton, prior, calibration, seen.pooled, with_draws=False)
    return EstimatedPerson(person, prior, trials, skeleton, recorded, calibration, seen, result, of_noise)


def held(skeleton: Skeleton) -> CalibrationPrior:
    """Return the prior without calibration: skeleton and instruments count as exact."""
    places = np.full(len(skeleton.markers), _HELD_SD_M)
    exact = FaultMixture.certain(_HELD_SD_M)
    plate, floor = (dict.fromkeys(names, exact) for names in (PLATE_UNKNOWNS, FLOOR_UNKNOWNS))
    return CalibrationPrior({}, places, InstrumentPrior(plate, floor, exact, exact, exact, trial_gain=exact))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Errors of every parameter in every condition.

    Attributes:
        parameters: "segment.parameter"; left and right count as one.
        errors: condition -> RMS error over people, over that of the literature.
        draws, seed: of the study.
    """

    parameters: tuple[str, ...]
    errors: Mapping[str, np.ndarray]
    draws: int
    seed: int

    def insensitive(self, kind: str) -> list[str]:
        """Return the parameters whose error stays small up to twice this noise's amplitude, smallest error first."""
        worst = np.max([self.errors[f"{kind} x {amplitude:g}"] for amplitude in AMPLITUDES], axis=0)
        return [self.parameters[i] for i in np.argsort(worst) if worst[i] < INSENSITIVE]

    def never(self) -> list[str]:
        """Return the parameters whose error is above 0.9 in every condition: walking does not show them at all."""
        best = np.min(list(self.errors.values()), axis=0)
        return [name for name, value in zip(self.parameters, best, strict=True) if value > 0.9]


def run_sensitivity(
    draws: int = 24,
    seed: int = 1,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Sensitivity:
    """Compute the errors in all conditions, with `draws` people each."""
    cases = [(condition, number) for condition in CONDITIONS.values() for number in range(draws)]
    drawn = in_parallel(partial(_run_draw, seed), cases, workers, progress)
    by_condition = {key: drawn[i * draws : (i + 1) * draws] for i, key in enumerate(CONDITIONS)}
    segments = walking_subject().literature.segments
    names = list(dict.fromkeys(segment.removesuffix("_r").removesuffix("_l") for segment in segments))
    parameters = tuple(f"{name}.{parameter}" for name in names for parameter in SHOWN)
    errors = {key: _errors(part, segments, names) for key, part in by_condition.items()}
    return Sensitivity(parameters, errors, draws, seed)


@dataclass(frozen=True, eq=False)
class _Draw:
    """Errors (s, 10) of the estimate and of the literature of one person, in prior standard deviations."""

    errors: np.ndarray
    literature_errors: np.ndarray


def _run_draw(seed: int, case: tuple[Scenario, int]) -> _Draw:
    person = estimate_person(seed, case)
    return _Draw(person.errors / person.prior.sd, person.literature_errors / person.prior.sd)


def _errors(draws: list[_Draw], segments: tuple[str, ...], names: list[str]) -> np.ndarray:
    """Return the RMS (len(names) * 7,) over people and sides, relative to the literature's."""
    squares, before = (
        np.square([getattr(draw, kind) for draw in draws]).mean(axis=0)[:, : len(SHOWN)]
        for kind in ("errors", "literature_errors")
    )
    of_name = [[i for i, s in enumerate(segments) if s.removesuffix("_r").removesuffix("_l") == name] for name in names]
    return np.sqrt([squares[rows].sum(axis=0) / before[rows].sum(axis=0) for rows in of_name]).ravel()
