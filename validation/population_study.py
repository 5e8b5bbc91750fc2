"""What does a wrong prior cost? People whom the tables do not describe, with the adults' prior and with their own.

Every person walks once, at a pace and with a posture and swing of trunk and arms that are the person's own, in a
laboratory with skin motion and calibration errors, and is estimated twice from the same recording: as if
nothing were known, and with what the subject file can say of such a person. What the recording says is then joined with
two more priors, without estimating anew: with the one learnt from others of the population, and with the distribution
from which the person was drawn, which is the best that any prior can do. A draw depends on seed, population and its
number only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kinertia.estimation.learnt_prior import FEWEST_PEOPLE, LearntPrior, PersonInformation, learn, person_information
from kinertia.estimation.prepared import known
from kinertia.estimation.prior import BspPrior, literature_prior, population_prior
from kinertia.estimation.simultaneous.fit import calibration_prior
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY, InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.observation import Observations, observe
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import mahalanobis_distance
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.motion.kinematics import Kinematics
from kinertia.settings import Attached, Instruments, Subject
from kinertia.studies.parallel import in_parallel
from kinertia.studies.sensitivity import WALK_S
from kinertia.synthetic.motions import Faults, measured
from kinertia.synthetic.walk import HEIGHT_M, MASS_KG, SEX, Manner, SyntheticTrial, walk, walking_subject
from kinertia.trial.sampled_data import rms
from kinertia.workflow.known_body import with_prosthesis
from kinertia.workflow.masses import with_attached_prior
from validation.joint_accuracy import WITHIN
from validation.other_prior import with_prior
from validation.population_bodies import POPULATIONS

LABORATORY = Faults("artefact", calibration=True)
COLUMNS = {"mass": slice(0, 1), "CoM": slice(1, 4), "inertia": slice(4, 7)}
"""Columns of `BodySegmentParameters.table`; products of inertia are in none."""
RUCKSACK = Attached(name="rucksack", segment="torso", mass_kg=None, com_mm=(-200.0, 300.0, 0.0), on_scale=False)
RUCKSACK_KG = 10.0
GAIN_SD_PERCENT = 0.2
"""SD stated by a laboratory that has put known weights on its plates: the literature's for fault-free ones."""
_PARTS = 4
"""Parts of a group; the prior of each is learnt from the others."""
INFORMED_SD = 0.5
"""A parameter's mean is informed by the group if its SD is less, in the literature's SDs."""


@dataclass(frozen=True, eq=False)
class PersonOutcome:
    """Outcome of one person with one prior.

    Attributes:
        errors, before: (s, 10) estimate and prior mean minus truth.
        sd: (s, 10) posterior SDs.
        moments_nm, moments_before_nm: RMS error of all joint moments that the parameters make, with the true motion and
            the true forces.
        unlike: whether the fit reports that the person is far from the prior.
        trial: the synthetic trial.
        information: information of the recording; None where the estimate did not start at the adults' mean.
    """

    errors: np.ndarray
    before: np.ndarray
    sd: np.ndarray
    moments_nm: float
    moments_before_nm: float
    unlike: bool
    trial: SyntheticTrial
    information: PersonInformation | None


@dataclass(frozen=True)
class PopulationAccuracy:
    """Accuracy over all people of a population with one prior.

    Attributes:
        title, prior: titles of the rows.
        people: number of people.
        rms, rms_before: by class of `COLUMNS`, RMS errors of the estimate and of its starting point, SI.
        coverage: share of all parameters within their 95 % intervals.
        moments_nm, moments_before_nm: RMS over people of the moment errors.
        unlike: share of people reported as far from the prior.
    """

    title: str
    prior: str
    people: int
    rms: Mapping[str, float]
    rms_before: Mapping[str, float]
    coverage: float
    moments_nm: float
    moments_before_nm: float
    unlike: float


@dataclass(frozen=True)
class MeanAccuracy:
    """Accuracy of the mean that was learnt from all people of a population.

    Attributes:
        title: title of the population.
        people: number of people.
        informed: number of parameters whose mean the trials inform (`INFORMED_SD`).
        rms, rms_before: RMS error of these, and of the tables, in the literature's SDs.
        coverage: share of these within their 95 % intervals.
        coverage_of_all: the same of all parameters.
    """

    title: str
    people: int
    informed: int
    rms: float
    rms_before: float
    coverage: float
    coverage_of_all: float


@dataclass(frozen=True)
class PopulationsStudy:
    """All results of the population study."""

    accuracies: tuple[PopulationAccuracy, ...]
    means: tuple[MeanAccuracy, ...]
    rucksacks: tuple[RucksackAccuracy, ...]


@dataclass(frozen=True)
class RucksackAccuracy:
    """Accuracy of the estimated mass of a rucksack of unknown mass.

    Attributes:
        people: number of people who carried one.
        gain_sd_percent: gain SD that the laboratory states, truly, of its plates; None: nothing.
        rms_kg, sd_kg: RMS error of its mass, and RMS of its SD by the estimate.
        coverage: share of people in which the mass is within its 95 % interval.
    """

    people: int
    gain_sd_percent: float | None
    rms_kg: float
    sd_kg: float
    coverage: float


def run_populations(
    people: int = 20, seed: int = 1, workers: int | None = None, progress: Callable[[float], None] = lambda share: None
) -> PopulationsStudy:
    """Run every population with all priors, learn its mean, and estimate people with a rucksack on plates of unknown
    and of stated gain.
    """
    cases = [(name, number) for name in (*POPULATIONS, RUCKSACK.name) for number in range(people)]
    drawn = in_parallel(partial(run_person, seed), cases, workers, progress)
    rows: list[PopulationAccuracy] = []
    means: list[MeanAccuracy] = []
    for i, name in enumerate(POPULATIONS):
        of_group, of_mean = of_population(name, drawn[i * people : (i + 1) * people])
        rows += of_group
        means += of_mean
    carried = zip(*drawn[len(POPULATIONS) * people :], strict=True)
    rucksacks = [
        _of_rucksack(gain, carried_people)
        for gain, carried_people in zip((None, GAIN_SD_PERCENT), carried, strict=True)
    ]
    return PopulationsStudy(tuple(rows), tuple(means), tuple(rucksacks))


def of_population(
    name: str, drawn: Sequence[tuple[PersonOutcome, ...]]
) -> tuple[list[PopulationAccuracy], list[MeanAccuracy]]:
    """Return a row for each prior, and the accuracy of the learnt mean (none for few people).

    Args:
        name: a key of `POPULATIONS`.
        drawn: outcomes of `run_person` for each person.
    """
    population, adults = POPULATIONS[name], literature_prior(walking_subject().literature)
    with_adults, with_own = (list(people_of_prior) for people_of_prior in zip(*drawn, strict=True))
    right = population.of(adults)
    outcomes = {
        "adults'": with_adults,
        "own": with_own,
        "learnt from others": _with_learnt_prior(with_adults),
        "exactly known": [_again(person, right) for person in with_adults],
    }
    rows = [
        _summarised(population.title, prior, people_of_prior)
        for prior, people_of_prior in outcomes.items()
        if people_of_prior
    ]
    if len(drawn) < FEWEST_PEOPLE:
        return rows, []
    return rows, [
        _of_mean(population.title, learn([known(person.information) for person in with_adults]), adults, right)
    ]


def _of_mean(title: str, learnt: LearntPrior, adults: BspPrior, right: BspPrior) -> MeanAccuracy:
    shift = ((right.mean.table() - adults.mean.table()) / adults.sd).ravel()
    error, informed = learnt.mean - shift, learnt.mean_sd < INFORMED_SD
    within = np.abs(error) < WITHIN * learnt.mean_sd
    return MeanAccuracy(
        title,
        learnt.people,
        int(informed.sum()),
        rms(error[informed]),
        rms(shift[informed]),
        float(within[informed].mean()),
        float(within.mean()),
    )


def _of_rucksack(gain_sd_percent: float | None, people: Sequence[PersonOutcome]) -> RucksackAccuracy:
    error, sd = (np.array([getattr(person, name)[-1, 0] for person in people]) for name in ("errors", "sd"))
    within = float(np.mean(np.abs(error) < WITHIN * sd))
    return RucksackAccuracy(len(people), gain_sd_percent, rms(error), rms(sd), within)


def run_person(seed: int, case: tuple[str, int]) -> tuple[PersonOutcome, ...]:
    """Estimate one person with the adults' prior and with the own one; with a rucksack, in the two laboratories."""
    name, number = case
    of_person, of_noise = np.random.SeedSequence(seed, spawn_key=(number,)).spawn(2)
    subject, rng = walking_subject(), np.random.default_rng(of_person)
    adults = literature_prior(subject.literature)
    if name == RUCKSACK.name:
        skeleton, with_rucksack = with_attached_prior(subject.skeleton, adults, [RUCKSACK], MASS_KG)
        true = with_rucksack.draw(rng).table()
        true[-1, 0] = RUCKSACK_KG
        person = replace(
            subject, skeleton=skeleton, bsp=BodySegmentParameters.from_table(with_rucksack.mean.segments, true)
        )
        cases = [(with_rucksack, Instruments()), (with_rucksack, Instruments(gain_sd_percent=GAIN_SD_PERCENT))]
    else:
        person = replace(subject, bsp=POPULATIONS[name].of(adults).draw(rng))
        cases = [(prior, Instruments()) for prior in (adults, own_prior(name, adults))]
    trial = walk(person, WALK_S, trapezoid=False, manner=Manner.draw(rng))
    outcomes = []
    for prior, instruments in cases:
        laboratory = replace(LABORATORY, instruments=instruments)
        recorded = measured([trial], laboratory, np.random.default_rng(of_noise))
        outcomes.append(_outcome(trial, *recorded, prior, adults, instruments))
    return tuple(outcomes)


def _with_learnt_prior(people: Sequence[PersonOutcome]) -> list[PersonOutcome]:
    """Estimate each person once more, with the prior learnt from other parts of the group; none where they are few.

    Combines the recording's information with the prior, without estimating motion and calibration again.
    """
    prior = literature_prior(walking_subject().literature)
    parts = [list(people[k::_PARTS]) for k in range(_PARTS)]
    outcomes = []
    for k, part in enumerate(parts):
        others = [known(person.information) for other in parts[:k] + parts[k + 1 :] for person in other]
        if len(others) < FEWEST_PEOPLE:
            return []
        group = learn(others).of(prior)
        outcomes += [_again(person, group) for person in part]
    return outcomes


def _again(person: PersonOutcome, group: BspPrior) -> PersonOutcome:
    seen = known(person.information)
    estimate, covariance = with_prior(seen, group)
    sd = np.sqrt(np.diag(covariance)).reshape(-1, 10)
    unlike = mahalanobis_distance(group, estimate, covariance).implausible
    return _compared(person.trial, estimate, group.mean, sd, unlike, seen)


def own_prior(name: str, adults: BspPrior) -> BspPrior:
    """Return the prior that a subject file makes of the adults' prior for a person of this population."""
    if name == "prosthesis":
        return with_prosthesis(with_prosthesis(adults, "shank_l"), "foot_l")
    content = {"name": name, "sex": SEX, "mass_kg": MASS_KG, "height_m": HEIGHT_M, "population": name}
    return population_prior(adults, Subject.model_validate(content)).prior


def _outcome(
    trial: SyntheticTrial,
    skeleton: Skeleton,
    recorded: Sequence[Kinematics],
    prior: BspPrior,
    adults: BspPrior,
    instruments: Instruments,
) -> PersonOutcome:
    seen: Observations = observe(skeleton, recorded, prior.mass_kg, Bandwidth.of(recorded))
    calibration = calibration_prior(
        skeleton, replace(GAIT27_UNCERTAINTY, instruments=InstrumentPrior.stated(instruments))
    )
    result: SimultaneousResult = estimate_simultaneous(skeleton, prior, calibration, seen.pooled, with_draws=False)
    information = None
    if np.array_equal(prior.mean.table(), adults.mean.table()):
        information = person_information("", adults, prior, result.bsp, result.bsp_covariance)
    sd = np.sqrt(np.diag(result.bsp_covariance)).reshape(-1, 10)
    unlike = mahalanobis_distance(prior, result.bsp, result.bsp_covariance).implausible
    return _compared(trial, result.bsp, prior.mean, sd, unlike, information)


def _compared(
    trial: SyntheticTrial,
    estimate: BodySegmentParameters,
    start: BodySegmentParameters,
    sd: np.ndarray,
    unlike: bool,
    information: PersonInformation | None,
) -> PersonOutcome:
    expected, after, before = (
        inverse_dynamics(trial.skeleton, bsp, trial.motion, trial.foot_loads)[:, 6:]
        for bsp in (trial.bsp, estimate, start)
    )
    return PersonOutcome(
        estimate.table() - trial.bsp.table(),
        start.table() - trial.bsp.table(),
        sd,
        rms(after - expected),
        rms(before - expected),
        unlike,
        trial,
        information,
    )


def _summarised(title: str, prior: str, people: Sequence[PersonOutcome]) -> PopulationAccuracy:
    errors, before, sd = (np.array([getattr(person, name) for person in people]) for name in ("errors", "before", "sd"))
    return PopulationAccuracy(
        title,
        prior,
        len(people),
        {name: rms(errors[..., columns]) for name, columns in COLUMNS.items()},
        {name: rms(before[..., columns]) for name, columns in COLUMNS.items()},
        float(np.mean(np.abs(errors) < WITHIN * sd)),
        rms(np.array([person.moments_nm for person in people])),
        rms(np.array([person.moments_before_nm for person in people])),
        float(np.mean([person.unlike for person in people])),
    )
