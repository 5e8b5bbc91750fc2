"""Runs the simultaneous estimate on measured trials of one person: priors, observations, outcome."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kinertia.estimation.identifiability import BaseParameters, base_parameters
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.instrument_errors import OTHER_SIGN, CalibrationEntry
from kinertia.estimation.simultaneous.instruments.plates import down_weighted
from kinertia.estimation.simultaneous.instruments.priors import (
    GAIT27_UNCERTAINTY,
    InstrumentInformation,
    ModelUncertainty,
)
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.markers.marker_noise import MarkerNoise
from kinertia.estimation.simultaneous.observation import CalibrationPrior, Observation, Observations, observe, reading
from kinertia.estimation.simultaneous.outcome import SimultaneousResult
from kinertia.estimation.simultaneous.search.problem import TERMS
from kinertia.estimation.simultaneous.solver import estimate_simultaneous
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.evidence import FreeMomentSign, MissingLoad
from kinertia.estimation.simultaneous.uncertainty.model_errors import placement
from kinertia.estimation.simultaneous.uncertainty.posterior_draws import PosteriorDraws
from kinertia.estimation.simultaneous.uncertainty.prior_plausibility import MahalanobisDistance, mahalanobis_distance
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.gait27 import VIRTUAL_TRUNK
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.kinematics import Kinematics
from kinertia.motion.workload import one_blas_thread

_STAYING_SD_M = 1e-4
"""Least standard deviation of markers that are fixed in the model."""
TRUNK_PLACE_SD_M = 0.08
"""Standard deviation of the virtual markers of a trunk without markers: it may lean by 6 degrees throughout."""
_VIRTUAL_TRUNK = [marker.label for marker in VIRTUAL_TRUNK]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Uncertainty and calibration found by the simultaneous estimate, besides the estimate itself.

    Attributes:
        prior_sd, sd: (s, 10) standard deviations of the body segment parameters before and after, in the table's order.
        covariance: (10 s, 10 s) posterior covariance of the table rows, segment after segment.
        calibration: quantities of joints, instruments and trunk, each with its standard deviations.
        marker_noise: per trial.
        iterations: Gauss-Newton steps.
        base: combinations of parameters that these motions determine, and those that no motion determines.
        instruments: information of these trials on plates and synchronisation.
        prior_mean: of the body segment parameters.
        mahalanobis_distance: distance of the estimate from the prior.
        free_moment_sign: evidence on the sign; None if it was not tested.
        marker_distances_m: per trial, distance of each marker from its position in the nearest of the other trials, for
            markers that other trials have.
        down_weighted: per trial, the share of its measured frames that have less weight because of impact transients.
        draws: of motion, parameters and calibration together.
        missing_loads: loads of which a part is missing; gains of these plates stay nominal.

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
    prior_mean: BodySegmentParameters
    mahalanobis_distance: MahalanobisDistance
    free_moment_sign: FreeMomentSign | None = None
    marker_distances_m: tuple[Mapping[str, float], ...] = field(default=())
    down_weighted: tuple[float, ...] = ()
    draws: PosteriorDraws = field(kw_only=True)
    missing_loads: tuple[MissingLoad, ...] = ()

    @property
    def instrument_errors(self) -> tuple[CalibrationEntry, ...]:
        """Entries of `calibration` for plates and synchronisation."""
        return tuple(entry for entry in self.calibration if entry.of_instrument)

    @property
    def information(self) -> np.ndarray:
        """Variance reduction (s, 10), 1 - posterior / prior variance: 0 none, 1 complete, NaN for fixed segments."""
        known = self.prior_sd > 0
        return np.where(known, 1.0 - np.square(self.sd / np.where(known, self.prior_sd, 1.0)), np.nan)


@dataclass(frozen=True, eq=False)
class SimultaneousFit:
    """Result of `fit_simultaneous`.

    Attributes:
        result: of the estimator.
        bsp: all segments, including those that are not estimated.
        skeleton: with the estimated marker positions and static coordinates.
        skeletons: the same per trial, with the trial's marker positions.
        posterior: standard deviations and calibration.
        motions: per trial, at the frames of its measured windows.
        trajectories: per trial, (f, c) coordinates of the frames of `Kinematics.trajectory_time`, since markers also
            show the motion between measured windows and around them.
        deviations: per trial, standard deviations of the curves in these frames; NaN in those that are not reported.
        foot_loads: per trial (w, 2, 6), corrected in position and time, at the motion's bandwidth.
    """

    result: SimultaneousResult
    bsp: BodySegmentParameters
    skeleton: Skeleton
    skeletons: tuple[Skeleton, ...]
    posterior: Posterior
    motions: tuple[Motion, ...]
    trajectories: tuple[np.ndarray, ...]
    deviations: tuple[CurveDeviations, ...]
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
    terms: Sequence[type[CostTerm]] = (),
) -> SimultaneousFit:
    """Estimate motion, BSPs and calibration of all trials together.

    Args:
        skeleton: calibrated.
        prior: of the body segment parameters, and the total mass of its segments by the scale.
        trials: kinematics of the trials.
        bandwidths: per trial, of motion and forces; derived from the trials if None.
        uncertainty: what else may change, and which segments are fixed.
        progress: called with the approximate share of the estimate that is done.
        otherwise: the same trials with other ground reactions, whose evidence is computed for comparison
            (`SimultaneousResult.evidence`).
        functional: kinematics of trials whose markers alone are used; they are not in the result.
        terms: of the cost, besides `TERMS`.
    """
    every = [*trials, *functional]
    used = used_skeleton(skeleton, every, uncertainty)
    bandwidths = bandwidths or Bandwidth.of(trials)
    seen = observed(used, prior, every, [*bandwidths, *Bandwidth.of(functional)], uncertainty)
    pooled = seen.pooled
    calibration = calibration_prior(used, uncertainty, seen.misplaced_m)
    count = len(trials)
    others = (
        [reading(*trial_inputs) for trial_inputs in zip(pooled[:count], otherwise, bandwidths, strict=True)]
        if otherwise
        else []
    )
    others += pooled[count:] if otherwise else ()
    result = estimate_simultaneous(used, prior, calibration, pooled, progress, others, (*TERMS, *terms)).of_first(count)
    staying = uncertainty.marker_sd_m is None
    calibrated = result.skeleton.carrying(None)
    calibrated = calibrated.with_markers(used.markers) if staying else calibrated
    offsets_m = [0.0 if staying else moved for moved in result.marker_offsets_m]
    inside = [np.flatnonzero(k.inside(o.time)) for k, o in zip(trials, pooled, strict=False)]
    motions = tuple(m.cut(frames) for m, frames in zip(result.motions, inside, strict=True))
    spans = [_trajectory_frames(observation, k) for observation, k in zip(pooled, trials, strict=False)]
    informed = any(o.dynamic.any() for o in pooled) or bool(uncertainty.instruments.session)
    known = result.curve_deviations if informed else [sd.of_motion_alone() for sd in result.curve_deviations]
    known = [
        with_placement(sd, calibrated, motion, observation, uncertainty)
        for sd, motion, observation in zip(known, result.motions, pooled, strict=False)
    ]
    curves = zip(known, pooled, spans, strict=False)
    return SimultaneousFit(
        result=result,
        bsp=uncertainty.whole(result.bsp),
        skeleton=calibrated,
        skeletons=tuple(calibrated.with_positions(calibrated.marker_locals + moved) for moved in offsets_m),
        posterior=_posterior(result, prior, seen, trials, motions, uncertainty),
        motions=motions,
        trajectories=tuple(
            k.with_smooth_ends(motion.q[span], bandwidth.motion_hz)
            for motion, span, k, bandwidth in zip(result.motions, spans, trials, bandwidths, strict=True)
        ),
        deviations=tuple(sd.spread_over(o.curve_frames - span.start, _size(span)) for sd, o, span in curves),
        foot_loads=tuple(loads[frames] for loads, frames in zip(result.foot_loads, inside, strict=True)),
    )


def with_placement(
    deviations: CurveDeviations,
    skeleton: Skeleton,
    motion: Motion,
    observation: Observation,
    uncertainty: ModelUncertainty,
) -> CurveDeviations:
    """Add to the deviations of angles what markers and fixed axes may be off by."""
    frames = observation.curve_frames
    misplaced_m = np.array([uncertainty.misplaced_m(marker.segment) for marker in skeleton.markers])
    seen = np.isfinite(observation.markers[frames]).all(axis=2)
    more = placement(skeleton, motion.q[frames], seen, misplaced_m, uncertainty.fixed_axes)
    return replace(deviations, coordinates=np.sqrt(np.square(deviations.coordinates) + more))


def _trajectory_frames(observation: Observation, kinematics: Kinematics) -> slice:
    """Return the frames of an observation that are those of `Kinematics.trajectory_time`."""
    time = kinematics.trajectory_time
    first = int(np.argmin(np.abs(observation.time - time[0])))
    return slice(first, first + len(time))


def _size(span: slice) -> int:
    return int(span.stop - span.start)


def _posterior(
    result: SimultaneousResult,
    prior: BspPrior,
    seen: Observations,
    trials: Sequence[Kinematics],
    motions: Sequence[Motion],
    uncertainty: ModelUncertainty,
) -> Posterior:
    """Return the uncertainty of a result from the first observations, those of these trials."""
    assert result.draws is not None
    observations = seen.pooled[: len(trials)]
    covariance, before = (uncertainty.whole_covariance(c) for c in (result.bsp_covariance, prior.covariance))
    complete = [m if k.complete else m.cut(slice(0, 0)) for m, k in zip(motions, trials, strict=True)]
    load_sd = [np.repeat([observation.force_sd, observation.moment_sd], 3) for observation in observations]
    reduced = (
        np.broadcast_to(observation.impact, observation.dynamic.shape)[observation.dynamic]
        for observation in observations
    )
    return Posterior(
        prior_sd=np.sqrt(np.diag(before)).reshape(-1, 10),
        sd=np.sqrt(np.diag(covariance)).reshape(-1, 10),
        covariance=covariance,
        calibration=result.calibration,
        marker_noise=seen.noise[: len(trials)],
        iterations=result.iterations,
        base=base_parameters(result.skeleton, result.bsp, prior.sd, complete, load_sd),
        instruments=result.instruments,
        prior_mean=uncertainty.whole(prior.mean),
        mahalanobis_distance=mahalanobis_distance(prior, result.bsp, result.bsp_covariance),
        marker_distances_m=_marker_distances(result, trials),
        down_weighted=tuple(map(down_weighted, reduced)),
        draws=result.draws.without_places() if uncertainty.marker_sd_m is None else result.draws,
        missing_loads=result.missing_loads,
    )


def compared_with(fitted: SimultaneousFit, other: SimultaneousFit) -> SimultaneousFit:
    """Mark errors that only one of two equally likely interpretations of the trials supports as contradicted."""
    elsewhere = {entry.key: entry.supported for entry in other.posterior.calibration}
    calibration = tuple(
        replace(entry, contradicted_by=OTHER_SIGN) if entry.supported and not elsewhere[entry.key] else entry
        for entry in fitted.posterior.calibration
    )
    return replace(fitted, posterior=replace(fitted.posterior, calibration=calibration))


def used_skeleton(skeleton: Skeleton, trials: Sequence[Kinematics], uncertainty: ModelUncertainty) -> Skeleton:
    """Return the skeleton with the markers that any of the trials has, and with the segments that are fixed."""
    shown = {label for k in trials for label in k.ik.labels}
    used = skeleton.with_markers([marker for marker in skeleton.markers if marker.label in shown])
    return used.carrying(uncertainty.fixed)


def observed(
    skeleton: Skeleton,
    prior: BspPrior,
    trials: Sequence[Kinematics],
    bandwidths: Sequence[Bandwidth],
    uncertainty: ModelUncertainty,
) -> Observations:
    """Return the observations that the estimate uses, from trials of a `used_skeleton`."""
    return observe(skeleton, trials, prior.mass_kg + uncertainty.fixed_kg, bandwidths)


def calibration_prior(
    skeleton: Skeleton, uncertainty: ModelUncertainty = GAIT27_UNCERTAINTY, misplaced_m: np.ndarray | float = 0.0
) -> CalibrationPrior:
    """Build the prior of the calibration of a skeleton with these markers, plates and synchronisation.

    Markers that are fixed in the model may be displaced by as much as they are observed to be (`misplaced_m`): taken as
    exact, they would force the motion into poses that the forces contradict. A trunk without markers may lean
    throughout.
    """
    known = uncertainty.marker_sd_m
    place_sd_m = np.maximum(misplaced_m, _STAYING_SD_M) if known is None else known
    places = np.broadcast_to(place_sd_m, len(skeleton.markers)).copy()
    places[[label in _VIRTUAL_TRUNK for label in skeleton.labels]] = TRUNK_PLACE_SD_M
    return CalibrationPrior(
        coordinates=uncertainty.coordinates,
        marker_sd_m=places,
        instruments=uncertainty.instruments,
        before=uncertainty.before,
        fixed_axes=uncertainty.fixed_axes,
    )


def _marker_distances(result: SimultaneousResult, trials: Sequence[Kinematics]) -> tuple[dict[str, float], ...]:
    """Return, per trial, the distance (m) of each marker from its position in the nearest of the other trials."""
    labels = result.skeleton.labels
    shown = np.array([np.isin(labels, k.ik.labels) for k in trials])
    places = np.where(shown[..., None], result.marker_offsets_m, np.nan)
    distances = []
    for k in range(len(trials)):
        away = np.linalg.norm(places[k] - np.delete(places, k, axis=0), axis=-1)
        closest = np.where(np.isnan(away), np.inf, away).min(axis=0, initial=np.inf)
        distances.append({label: float(m) for label, m in zip(labels, closest, strict=True) if np.isfinite(m)})
    return tuple(distances)
