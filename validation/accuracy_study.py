"""Errors and error bars of many people drawn from the literature's prior, measured and estimated.

`run_accuracy` compares errors with error bars: how often the truth lies within 95 % intervals (coverage), RMS error
over posterior deviation (ratio), and errors against those of the literature. A draw depends on seed, scenario and its
number only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from kinertia.estimation.identifiability import evidence
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.fit import with_placement
from kinertia.estimation.simultaneous.observation import Observation
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.report.pages.truth_comparison import JOINTS
from kinertia.studies.parallel import in_parallel
from kinertia.studies.plan import Information
from kinertia.studies.sensitivity import UNCERTAINTY, Scenario, estimate_person
from kinertia.synthetic.motions import Faults
from kinertia.synthetic.walk import SyntheticTrial
from kinertia.trial.sampled_data import rms
from validation.joint_accuracy import (
    WITHIN,
    Before,
    JointAccuracy,
    JointErrors,
    Outcome,
    joint_accuracy,
    joint_errors,
)

CLASSES = {
    "mass": slice(0, 1),
    "CoM": slice(1, 4),
    "moments of inertia": slice(4, 7),
    "products of inertia": slice(7, 10),
}
"""Columns of `BodySegmentParameters.table`."""
EVIDENCE = ("measured", "informed", "assumed")
"""Parameters of all kinds by what stands behind their estimate (`identifiability.evidence`)."""
_TRIES = 500


PROOF = {
    "study": Scenario("the study's noise", Faults("study")),
    "artefact": Scenario("skin motion linear in joint angles, sound instruments", Faults("artefact")),
    "study_calibration": Scenario("the study's noise, calibration errors", Faults("study", calibration=True)),
    "artefact_calibration": Scenario("skin motion, calibration errors", Faults("artefact", calibration=True)),
    "faults": Scenario(
        "skin motion; left plate 20 mm off, forces 10 ms late, hip centres 10 mm off",
        Faults("artefact", hips_m=0.010, plate_m=0.020, delay_s=0.010),
    ),
    "mixed": Scenario(
        "skin motion, two thirds of it linear in joint angles, calibration errors", Faults("mixed", calibration=True)
    ),
    "clusters": Scenario(
        "skin motion of rigid clusters with the stride, not the joints; calibration errors",
        Faults("clusters", calibration=True),
    ),
    "walks": Scenario("skin motion, twelve strides at two paces", Faults("artefact"), others=("walk", "fast walk")),
    "faulty_walks": Scenario(
        "skin motion; left plate 20 mm off, forces 10 ms late, hip centres 10 mm off; three walks of a session",
        Faults("artefact", hips_m=0.010, plate_m=0.020, delay_s=0.010),
        others=("walk", "fast walk"),
    ),
    "session": Scenario(
        "skin motion, calibration errors; squats, arm swings and trunk sway besides the walk",
        Faults("artefact", calibration=True),
        others=("squat", "arm swing", "trunk sway"),
    ),
}
"""Scenarios for which error bars are made."""
BREAKS = {
    "axes": Scenario("axes of knees, ankles and elbows 5 degrees off", Faults("artefact", axes_rad=np.radians(5.0))),
    "hips": Scenario("hip centres 15 mm off, calibration switched off", Faults("artefact", hips_m=0.015), False),
    "wobbling": Scenario("40 % of the thighs' mass wobbles", Faults("artefact", wobbling=0.4)),
    "gain": Scenario("right plate's gain 2 % off, calibration switched off", Faults("artefact", gain=0.02), False),
}
"""Scenarios for which error bars are not made: how far they fail."""
SCENARIOS = PROOF | BREAKS


@dataclass(frozen=True, eq=False)
class Draw:
    """Estimate of one person, measured once.

    Attributes:
        errors, literature_errors: (s, 10) estimate and literature minus truth, in the table's order and units.
        prior_sd, sd: (s, 10) prior and posterior SDs.
        bound: (s, 10) the latter at the true parameters, motion and skeleton: the Cramér-Rao bound of the estimator's
            own noise model, prior included.
        attainable: per class, chance that an estimate at the bound has a smaller RMS error than the literature.
        joints: errors per joint.
        converged: whether the estimate converged.
    """

    errors: np.ndarray
    literature_errors: np.ndarray
    prior_sd: np.ndarray
    sd: np.ndarray
    bound: np.ndarray
    attainable: Mapping[str, float]
    joints: Mapping[str, JointErrors]
    converged: bool


@dataclass(frozen=True)
class ClassAccuracy:
    """Accuracy of one class of parameters over all draws of a scenario; classes by evidence are in prior SDs.

    Attributes:
        coverage: share of parameters within their 95 % interval.
        coverage_sd: its standard error over draws.
        ratio: RMS of error over posterior SD.
        rms, rms_literature: RMS errors of the estimate and the literature, SI.
        bound: RMS of the Cramér-Rao bound of the estimator's own noise model at the truth, prior included, SI.
        better: share of draws in which the RMS error is below the literature's.
        attainable: what this share would be for an estimate at the bound; NaN for classes by evidence.
    """

    coverage: float
    coverage_sd: float
    ratio: float
    rms: float
    rms_literature: float
    bound: float
    better: float
    attainable: float = np.nan


@dataclass(frozen=True)
class ScenarioAccuracy:
    """Accuracy of all classes of parameters and all joints of one scenario, and the share of draws that converged."""

    title: str
    draws: int
    classes: Mapping[str, ClassAccuracy]
    joints: Mapping[str, JointAccuracy]
    converged: float


def run_accuracy(
    scenarios: Mapping[str, Scenario],
    draws: int = 100,
    seed: int = 1,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, ScenarioAccuracy]:
    """Compute the accuracy in these scenarios, `draws` people each."""
    drawn = run_draws(scenarios, draws, seed, workers, progress)
    return {key: summarised(scenario.title, drawn[key]) for key, scenario in scenarios.items()}


def run_draws(
    scenarios: Mapping[str, Scenario],
    draws: int,
    seed: int,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, list[Draw]]:
    """Run all draws of every scenario, in parallel."""
    cases = [(scenario, number) for scenario in scenarios.values() for number in range(draws)]
    drawn = in_parallel(partial(run_draw, seed), cases, workers, progress)
    return {key: drawn[i * draws : (i + 1) * draws] for i, key in enumerate(scenarios)}


def run_draw(seed: int, case: tuple[Scenario, int]) -> Draw:
    """Run one draw; people of one number are the same in every scenario."""
    drawn = estimate_person(seed, case)
    person, prior, trials, seen, result = drawn.person, drawn.prior, drawn.trials, drawn.seen, drawn.result
    trial = trials[0]
    true = [at_truth(o, truth) for o, truth in zip(seen.separate, trials, strict=True)]
    there = MapProblem(trial.skeleton, replace(prior, mean=person.bsp), drawn.calibration, true)
    bound = Information(there, seen.repeats).root(range(len(true)))
    inside = np.flatnonzero(seen.separate[0].dynamic)
    after = Outcome(result.skeleton, result.bsp, result.motions[0].cut(inside), result.reactions[0])
    placed = result.skeleton.carrying(None), result.motions[0], seen.pooled[0], UNCERTAINTY
    deviations = with_placement(result.curve_deviations[0], *placed).at(np.isin(seen.separate[0].curve_frames, inside))
    return Draw(
        drawn.errors,
        drawn.literature_errors,
        prior.sd,
        np.sqrt(np.diag(result.bsp_covariance)).reshape(-1, 10),
        np.linalg.norm(bound, axis=1).reshape(-1, 10),
        attainable(prior, bound, drawn.rng),
        joint_errors(trial, Before(drawn.skeleton, prior.mean, drawn.recorded[0]), after, deviations),
        result.converged,
    )


def at_truth(seen: Observation, trial: SyntheticTrial) -> Observation:
    """Replace the coordinates of inverse kinematics in the observation by the trial's true ones."""
    return replace(seen, q=trial.motion.q[np.searchsorted(trial.time, seen.time - 1e-9)])


def attainable(prior: BspPrior, root: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """Return per class the chance that an unbiased estimate of covariance R R^T (10 s, k) errs less than the prior.

    Its errors and its distance from the prior's mean are independent; covariances of the two add up to the prior's.
    """
    moved, vectors = np.linalg.eigh(prior.given_scale()[1] - root @ root.T)
    error = root @ rng.standard_normal((root.shape[1], _TRIES))
    change = vectors @ (np.sqrt(np.maximum(moved, 0.0))[:, None] * rng.standard_normal((len(moved), _TRIES)))
    chances = {}
    for name, columns in CLASSES.items():
        after, before = (part.reshape(-1, 10, _TRIES)[:, columns] for part in (error, error + change))
        squares = (np.square(part).sum(axis=(0, 1)) for part in (after, before))
        chances[name] = float(np.mean(np.less(*squares)))
    return chances


def summarised(title: str, draws: Sequence[Draw]) -> ScenarioAccuracy:
    """Summarise coverage, ratio and errors by class and by evidence."""
    errors, before, sd, bound, prior = (
        np.array([getattr(d, name) for d in draws])
        for name in ("errors", "literature_errors", "sd", "bound", "prior_sd")
    )
    classes = {}
    for name, columns in CLASSES.items():
        plain = _class(*(part[..., columns] for part in (errors, before, sd, bound)))
        classes[name] = replace(plain, attainable=float(np.mean([d.attainable[name] for d in draws])))
    words = np.vectorize(evidence)(1.0 - np.square(sd / prior))
    for word in EVIDENCE:
        chosen = np.where(words == word, 1.0, np.nan) / prior
        if np.isfinite(chosen).any():
            classes[word] = _class(*(part * chosen for part in (errors, before, sd, bound)))
    joints = {joint: joint_accuracy([d.joints[joint] for d in draws]) for joint in JOINTS}
    return ScenarioAccuracy(title, len(draws), classes, joints, float(np.mean([d.converged for d in draws])))


def _class(errors: np.ndarray, before: np.ndarray, sd: np.ndarray, bound: np.ndarray) -> ClassAccuracy:
    """Summarise arrays (draws, s, k); NaN is left out, and so is a draw with nothing else."""
    left = np.isfinite(errors).any(axis=(1, 2))
    errors, before, sd, bound = (part[left] for part in (errors, before, sd, bound))
    away = errors / sd
    within = np.nanmean(np.where(np.isfinite(away), np.abs(away) < WITHIN, np.nan), axis=(1, 2))
    by_class, each_before = (np.nanmean(np.square(part), axis=(1, 2)) for part in (errors, before))
    return ClassAccuracy(
        float(within.mean()),
        float(within.std() / np.sqrt(len(within))),
        rms(away),
        rms(errors),
        rms(before),
        rms(bound),
        float(np.mean(by_class < each_before)),
    )
