"""Predicts the uncertainty of every body segment parameter for candidate motions, to decide what to record.

Candidates are measured trials of a person, or the package's motions of its synthetic person, with skin motion of
published size in the walk and up to twice that in the others. Nothing is estimated: standard deviations follow from the
information of each trial at the literature's parameters (`predicted.Information`), which is summed over several trials,
except for errors that recur (`marker_noise`).

The information of the simultaneous estimate (`simultaneous`) depends on the data only through the point at which it is
evaluated. At the literature's parameters it predicts what a recording will determine; at the truth it is the Cramér-Rao
bound of the estimator's own noise model, prior included.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

from kinertia.estimation.identifiability import evidence
from kinertia.estimation.prepared import Prepared
from kinertia.estimation.prior import BspPrior, literature_prior
from kinertia.estimation.simultaneous.fit import calibration_prior, observed, used_skeleton
from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.instruments.priors import GAIT27_UNCERTAINTY, ModelUncertainty
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.linear_algebra.normal_equations import StaticInformation
from kinertia.estimation.simultaneous.mixture_prior import GaussianPrior
from kinertia.estimation.simultaneous.search.problem import MapProblem
from kinertia.estimation.simultaneous.terms.model_terms import as_displaced
from kinertia.model.bsp import PARAMETERS, UNITS
from kinertia.model.log_cholesky import table_jacobian
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.workload import one_blas_thread
from kinertia.synthetic.motions import MOTIONS, Faults, measured
from kinertia.synthetic.walk import walking_subject

_LARGEST_SET = 3
_SEED = 1
_ROUNDS = 3
"""Iterations, each of which sets the instruments' priors to the posterior of the one before."""


@dataclass(frozen=True, eq=False)
class Information:
    """Information of several trials of a person, and of the prior, on parameters and calibration.

    Attributes:
        problem: the estimate at whose start it is evaluated: the observations' coordinates, the prior's mean. It holds
            each trial's own observations (`observation.Observations`): repeats are counted here.
        repeats: (t, t) how often the errors of each trial recur in each (`marker_noise.repeats`).
    """

    problem: MapProblem
    repeats: np.ndarray

    @cached_property
    def of_trials(self) -> tuple[np.ndarray, ...]:
        """Information (S, S) of each trial on the static unknowns, with the motion eliminated."""
        problem = self.problem
        trials = (problem.eliminated(k, start, problem.layout.start) for k, start in enumerate(problem.start))
        return tuple(trial.information for trial in trials)

    @cached_property
    def of_prior(self) -> np.ndarray:
        """Information (S, S) of all priors but the instruments'."""
        return self.problem.prior_information(self.problem.layout.start)

    def root(self, trials: Iterable[int]) -> np.ndarray:
        """Return R (10 s, S), where R R^T is the covariance of body segment parameters after these trials together."""
        chosen = list(trials)
        counts = self.repeats[np.ix_(chosen, chosen)].sum(axis=1)
        layout, information = self.problem.layout, self.of_prior.copy()
        for k, count in zip(chosen, counts, strict=True):
            sd = self.problem.displaced_sd[k]
            information = information + as_displaced(self.of_trials[k] / count, layout.displaced, sd)
        first = layout.in_root
        information[first, first] += self._of_instruments(StaticInformation.of(information, first.stop).first)
        theta = layout[BSP]
        chain = block_diag(*table_jacobian(self.problem.layout.start[theta]))
        result: np.ndarray = chain @ StaticInformation.of(information, first.stop).root_of_covariance()[theta]
        return result

    def _of_instruments(self, rest: np.ndarray) -> np.ndarray:
        """Return the information (n, n) of instrument priors if data, with information `rest`, show them fault-free."""
        priors, places = self.problem.layout.error_priors, self.problem.layout.errors
        gaussian, result = GaussianPrior.of(priors), np.zeros_like(rest)
        for _ in range(_ROUNDS):
            result[places, places] = gaussian.precision
            covariance = np.linalg.inv(rest + result)[places, places]
            gaussian = gaussian.updated(priors, np.zeros(len(priors.individual)), covariance)
        result[places, places] = gaussian.precision
        return result

    def sd(self, trials: Iterable[int]) -> np.ndarray:
        """Return standard deviations (s, 10) of the body segment parameters after these trials together."""
        result: np.ndarray = np.linalg.norm(self.root(trials), axis=1).reshape(-1, 10)
        return result


@dataclass(frozen=True, eq=False)
class Plan:
    """Predicted standard deviations.

    Attributes:
        segments: names.
        prior_sd: (s, 10), in the order of `BodySegmentParameters.table`.
        sd: set of candidates -> (s, 10) standard deviations after recording them; every candidate alone, and the most
            informative set of each size up to three.

    Examples:
        >>> plan = kinertia.Plan(("shank_r",), np.full((1, 10), 2.0), {("walk",): np.full((1, 10), 0.5)})
        >>> plan.counts(("walk",))
        {'measured': 10, 'informed': 0, 'assumed': 0}
    """

    segments: tuple[str, ...]
    prior_sd: np.ndarray
    sd: Mapping[tuple[str, ...], np.ndarray]

    def information(self, candidates: tuple[str, ...]) -> np.ndarray:
        """Return the variance reduction (s, 10): 1 - predicted variance / prior variance."""
        result: np.ndarray = 1.0 - np.square(self.sd[candidates] / self.prior_sd)
        return result

    def counts(self, candidates: tuple[str, ...]) -> dict[str, int]:
        """Count the parameters that these candidates would inform well (measured), partly (informed) and not
        (assumed)."""
        words = [evidence(value) for value in self.information(candidates).ravel()]
        return {word: words.count(word) for word in ("measured", "informed", "assumed")}

    @property
    def table(self) -> pd.DataFrame:
        """Return one row per parameter: segment, parameter, unit, prior_sd, and a column of SDs per set ("a + b")."""
        s = len(self.segments)
        columns = {" + ".join(names): sd.ravel() for names, sd in self.sd.items()}
        return pd.DataFrame(
            {
                "segment": np.repeat(np.array(self.segments, dtype=object), len(PARAMETERS)),
                "parameter": PARAMETERS * s,
                "unit": UNITS * s,
                "prior_sd": self.prior_sd.ravel(),
                **columns,
            }
        )


def plan(ready: Prepared | None = None, cutoff_hz: float | Literal["gcv"] = "gcv") -> Plan:
    """Predict the uncertainty of every body segment parameter after candidate motions, without any estimate.

    Args:
        ready: a person with the trials to choose from; the package's synthetic person and motions if None.
        cutoff_hz: as in `Settings`.
    """
    if ready is None:
        return plan_synthetic()
    return plan_measured(ready.skeleton, ready.prior, ready.kinematics, cutoff_hz, ready.uncertainty)


@one_blas_thread
def plan_measured(
    skeleton: Skeleton,
    prior: BspPrior,
    trials: Sequence[Kinematics],
    cutoff_hz: float | Literal["gcv"],
    uncertainty: ModelUncertainty = GAIT27_UNCERTAINTY,
) -> Plan:
    """Predict standard deviations from measured trials of one person with different names; as `fit_simultaneous`."""
    bandwidths = Bandwidth.of(trials, cutoff_hz)
    used = used_skeleton(skeleton, trials, uncertainty)

    def information_of(chosen: Sequence[int]) -> Information:
        seen = observed(used, prior, [trials[k] for k in chosen], [bandwidths[k] for k in chosen], uncertainty)
        calibration = calibration_prior(used, uncertainty, seen.misplaced_m)
        return Information(MapProblem(used, prior, calibration, seen.separate), seen.repeats)

    everything = tuple(range(len(trials)))
    whole = information_of(everything)
    sets: list[tuple[int, ...]] = [(k,) for k in everything]
    sets += [
        max(combinations(everything, size), key=lambda chosen: _gain(whole, prior, chosen))
        for size in range(2, min(_LARGEST_SET, len(trials)) + 1)
    ]
    # chosen with the errors of all trials; a fit of each set would have the set's own errors
    of_sets = {chosen: whole if chosen == everything else information_of(chosen) for chosen in sets}
    predicted = {chosen: information.sd(range(len(chosen))) for chosen, information in of_sets.items()}
    names = [k.trial.name for k in trials]
    return Plan(
        prior.mean.segments, prior.sd, {tuple(names[k] for k in chosen): sd for chosen, sd in predicted.items()}
    )


def plan_synthetic() -> Plan:
    """Predict standard deviations from the package's motions, each 5 s."""
    subject = walking_subject()
    prior = literature_prior(subject.literature)
    person = replace(subject, bsp=prior.mean)
    motions = [made(person) for made in MOTIONS.values()]
    skeleton, trials = measured(motions, Faults("artefact"), np.random.default_rng(_SEED))
    named = [replace(k, trial=replace(k.trial, name=name)) for name, k in zip(MOTIONS, trials, strict=True)]
    return plan_measured(skeleton, prior, named, "gcv")


def _gain(information: Information, prior: BspPrior, chosen: tuple[int, ...]) -> float:
    """Return the variance reduction summed over all parameters."""
    return float((1.0 - np.square(information.sd(chosen) / prior.sd)).sum())
