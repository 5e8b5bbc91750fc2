"""Runs the simultaneous estimate on measured trials of one person: priors, observations, outcome."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.estimation.identifiability import BaseParameters, base_parameters
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.bandwidth import Bandwidth
from kinertia.estimation.simultaneous.calibration_entry import CalibrationEntry
from kinertia.estimation.simultaneous.cost_term import CostTerm
from kinertia.estimation.simultaneous.evidence import FreeMomentSign
from kinertia.estimation.simultaneous.impacts import down_weighted
from kinertia.estimation.simultaneous.instrument_errors import OTHER_SIGN
from kinertia.estimation.simultaneous.instruments import InstrumentInformation
from kinertia.estimation.simultaneous.marker_noise import MarkerNoise
from kinertia.estimation.simultaneous.model_uncertainty import GAIT27_UNCERTAINTY, ModelUncertainty
from kinertia.estimation.simultaneous.observation import Observations, observe, reading
from kinertia.estimation.simultaneous.observed_trial import CalibrationPrior
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.posterior_draws import PosteriorDraws
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.simultaneous.terms import TERMS
from kinertia.estimation.simultaneous.unlike import Unlikeness, unlikeness
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.single_blas_thread import one_blas_thread

_STAYING_SD_M = 1e-4
"""At least, of markers that stay where a model has them."""
TRUNK_PLACE_SD_M = 0.08
"""Of the virtual markers of a trunk that nobody sees: it may lean by 6 degrees all the time."""
_VIRTUAL_TRUNK = [marker.label for marker in VIRTUAL_TRUNK]


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the simultaneous estimate says beyond the estimate itself.

    Attributes:
        prior_sd, sd: (s, 10) deviations of the body segment parameters before and after, in the table's order.
        covariance: (10 s, 10 s) posterior covariance of the table rows, segment after segment.
        calibration: joints, instruments and trunk, each quantity with its deviations.
        marker_noise: per trial.
        iterations: Gauss-Newton steps.
        base: which combinations of parameters these motions show, and which none ever shows.
        instruments: what these trials say of plates and clock.
        prior_mean: of the body segment parameters; None in files of before, where it was not written.
        unlikeness: how far the estimate is from the prior; None in files of before.
        free_moment_sign: what was found of it; None where there was nothing to ask.
        marker_distances_m: per trial, how far each marker is from where it is in the nearest of the other trials; of
            those that no other trial shows nothing.
        down_weighted: per trial, the share of its measured frames that impacts leave less weight.
        draws: of motion, parameters and calibration together; None in files of before.

    Examples:
        >>> fit.posterior.sd.shape, bool((fit.posterior.sd <= fit.posterior.prior_sd * 1.0001).all())
        ((12, 10), True)
    """

    prior_sd: np.ndarray
    sd: np.ndarray
    covariance: np.ndarray
    calibration: tuple[CalibrationEntry, ...]
    marker_noise: tuple[MarkerNoise, ...]
    iterations: int
    base: BaseParameters
    instruments: InstrumentInformation
    prior_mean: BodySegmentParameters | None = None
    unlikeness: Unlikeness | None = None
    free_moment_sign: FreeMomentSign | None = None
    marker_distances_m: tuple[Mapping[str, float], ...] = field(default=())
    down_weighted: tuple[float, ...] = ()
    draws: PosteriorDraws | None = None

    @property
    def instrument_errors(self) -> tuple[CalibrationEntry, ...]:
        """What `calibration` has of plates and synchronisation."""
        return tuple(one for one in self.calibration if one.of_instrument)

    @property
    def information(self) -> np.ndarray:
        """(s, 10): 1 - posterior variance / prior variance; 0 nothing learnt, 1 everything; NaN for segments held."""
        known = self.prior_sd > 0
        return np.where(known, 1.0 - np.square(self.sd / np.where(known, self.prior_sd, 1.0)), np.nan)


@dataclass(frozen=True, eq=False)
class SimultaneousFit:
    """Outcome of `fit_simultaneous`.

    Attributes:
        result: of the estimator.
        bsp: all segments, those that are held included.
        skeleton: with the estimated marker positions and static coordinates.
        skeletons: the same per trial, with the markers where they are in it.
        posterior: deviations and calibration.
        motions: per trial, at the frames of its measured window.
        courses: per trial, (f, c) coordinates of all frames from the first to the last of these: markers show the
            motion between measured stretches, too.
        foot_loads: per trial (w, 2, 6) at the corrected place and time, of the motion's bandwidth.
    """

    result: SimultaneousResult
    bsp: BodySegmentParameters
    skeleton: Skeleton
    skeletons: tuple[Skeleton, ...]
    posterior: Posterior
    motions: tuple[Motion, ...]
    courses: tuple[np.ndarray, ...]
    foot_loads: tuple[np.ndarray, ...]


@one_blas_thread
def fit_simultaneous(
    skeleton: Skeleton,
    prior: BspPrior,
    trials: Sequence[Kinematics],
    bandwidths: Sequence[Bandwidth] | None = None,
    uncertainty: ModelUncertainty = GAIT27_UNCERTAINTY,
    progress: Callable[[float], None] = lambda share: None,
    otherwise: Sequence[Kinematics] = (),
    functional: Sequence[Kinematics] = (),
    terms: Sequence[type[CostTerm]] = TERMS,
) -> SimultaneousFit:
    """Estimate motion, BSPs and calibration of all trials together.

    Args:
        skeleton: calibrated.
        prior: of the body segment parameters, and the total mass of its segments by the scale.
        trials: kinematics of the trials.
        bandwidths: per trial, of motion and forces; found from the trials if None.
        uncertainty: what may move beside these segments.
        progress: told the share of the estimate that is done, roughly.
        otherwise: the same trials with other ground reactions, of which it is asked how likely they are beside
            (`SimultaneousResult.evidence`).
        functional: kinematics of trials whose markers alone are used; the outcome has none of them.
        terms: of the cost.
    """
    every = [*trials, *functional]
    used = used_skeleton(skeleton, every, uncertainty)
    bandwidths = bandwidths or Bandwidth.of(trials)
    seen = observed(used, prior, every, [*bandwidths, *Bandwidth.of(functional)], uncertainty)
    together = seen.together
    calibration = calibration_prior(used, uncertainty, seen.misplaced_m)
    count = len(trials)
    others = [reading(*each) for each in zip(together[:count], otherwise, bandwidths, strict=True)] if otherwise else []
    others += together[count:] if otherwise else ()
    result = estimate_simultaneous(used, prior, calibration, together, progress, others, terms).of_first(count)
    together = together[:count]
    calibrated = result.skeleton.carrying(None)
    staying = uncertainty.marker_sd_m is None
    if staying:
        calibrated = calibrated.with_markers(used.markers)
    dynamic = [np.flatnonzero(o.dynamic) for o in together]
    motions = tuple(m.cut(frames) for m, frames in zip(result.motions, dynamic, strict=True))
    courses = tuple(m.q[at[0] : at[-1] + 1] for m, at in zip(result.motions, dynamic, strict=True))
    loads = tuple(every[o.dynamic] for every, o in zip(result.foot_loads, together, strict=True))
    covariance, before = (uncertainty.whole_covariance(c) for c in (result.bsp_covariance, prior.covariance))
    posterior = Posterior(
        np.sqrt(np.diag(before)).reshape(-1, 10),
        np.sqrt(np.diag(covariance)).reshape(-1, 10),
        covariance,
        result.calibration,
        seen.noise[:count],
        result.iterations,
        base_parameters(
            result.skeleton, result.bsp, prior.sd, motions, [np.repeat([o.force_sd, o.moment_sd], 3) for o in together]
        ),
        result.instruments,
        uncertainty.whole(prior.mean),
        unlikeness(prior, result.bsp, result.bsp_covariance),
        marker_distances_m=_marker_distances(result, trials),
        down_weighted=tuple(down_weighted(np.broadcast_to(o.impact, o.dynamic.shape)[o.dynamic]) for o in together),
        draws=result.draws.without_places() if staying else result.draws,
    )
    return SimultaneousFit(
        result,
        uncertainty.whole(result.bsp),
        calibrated,
        tuple(
            calibrated.with_places(calibrated.marker_locals + (0.0 if staying else m)) for m in result.displacements_m
        ),
        posterior,
        motions,
        courses,
        loads,
    )


def held_against(fitted: SimultaneousFit, other: SimultaneousFit) -> SimultaneousFit:
    """The same, where another reading of the same trials is as likely: errors that only one of both supports are
    contradicted.
    """
    elsewhere = {one.key: one.supported for one in other.posterior.calibration}
    calibration = tuple(
        replace(one, contradicted_by=OTHER_SIGN) if one.supported and not elsewhere[one.key] else one
        for one in fitted.posterior.calibration
    )
    return replace(fitted, posterior=replace(fitted.posterior, calibration=calibration))


def used_skeleton(skeleton: Skeleton, trials: Sequence[Kinematics], uncertainty: ModelUncertainty) -> Skeleton:
    """The skeleton with the markers that any of the trials shows, and the segments that are held."""
    shown = {label for k in trials for label in k.ik.labels}
    used = skeleton.with_markers([marker for marker in skeleton.markers if marker.label in shown])
    return used.carrying(uncertainty.held)


def observed(
    skeleton: Skeleton,
    prior: BspPrior,
    trials: Sequence[Kinematics],
    bandwidths: Sequence[Bandwidth],
    uncertainty: ModelUncertainty,
) -> Observations:
    """What the estimate sees of trials of a `used_skeleton`."""
    return observe(skeleton, trials, prior.mass_kg + uncertainty.held_kg, bandwidths)


def calibration_prior(
    skeleton: Skeleton, uncertainty: ModelUncertainty = GAIT27_UNCERTAINTY, misplaced_m: np.ndarray | float = 0.0
) -> CalibrationPrior:
    """How far a calibrated skeleton with these markers, plates and clock may be off.

    Markers that stay where a model has them are off by as much as they are found to be (`misplaced_m`): taken as exact,
    they would hold the motion in poses that the forces contradict. A trunk that no marker shows may lean all the time.
    """
    known = uncertainty.marker_sd_m
    each = np.maximum(misplaced_m, _STAYING_SD_M) if known is None else known
    places = np.broadcast_to(each, len(skeleton.markers)).copy()
    places[[label in _VIRTUAL_TRUNK for label in skeleton.labels]] = TRUNK_PLACE_SD_M
    return CalibrationPrior(uncertainty.coordinates, places, uncertainty.instruments, uncertainty.before)


def _marker_distances(result: SimultaneousResult, trials: Sequence[Kinematics]) -> tuple[dict[str, float], ...]:
    """Per trial how far each marker is from where it is in the nearest of the other trials, m."""
    labels = result.skeleton.labels
    shown = np.array([np.isin(labels, k.ik.labels) for k in trials])
    places = np.where(shown[..., None], result.displacements_m, np.nan)
    distances = []
    for k in range(len(trials)):
        away = np.linalg.norm(places[k] - np.delete(places, k, axis=0), axis=-1)
        closest = np.where(np.isnan(away), np.inf, away).min(axis=0, initial=np.inf)
        distances.append({label: float(m) for label, m in zip(labels, closest, strict=True) if np.isfinite(m)})
    return tuple(distances)
