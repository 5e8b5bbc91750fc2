"""Holds the observations of a measured trial, and extracts them: frames, loads, skin patterns, marker noise.

Noise is estimated by `marker_noise`. All standard deviations are inflated where errors recur.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.estimation.simultaneous.instruments.plates import FootPlates, impact_factors, plate_middles, swing_factors
from kinertia.estimation.simultaneous.instruments.priors import InstrumentPrior
from kinertia.estimation.simultaneous.linear_algebra.motion_basis import Bandwidth
from kinertia.estimation.simultaneous.markers.marker_errors import ErrorProcess
from kinertia.estimation.simultaneous.markers.marker_noise import (
    MarkerNoise,
    WithoutSkin,
    correlated_frames,
    marker_noise,
    markers_in_common,
    repeats,
    root_mean_square,
    taken_by_chance,
    weighed,
)
from kinertia.estimation.simultaneous.markers.skin import SkinPatterns, girdle_variance, skin_patterns
from kinertia.model.skeleton import GRAVITY_M_S2, Skeleton
from kinertia.motion.ground_reactions import ground_reactions
from kinertia.motion.kinematics import AROUND_WINDOW_S, Kinematics
from kinertia.motion.smoothing import smooth
from kinertia.motion.workload import pieces
from kinertia.settings import ForceCutoff
from kinertia.trial.sampled_data import nearest_samples, within

FORCE_SD_OF_WEIGHT = 0.005
"""Standard deviation of the root force from that of rigid segments, as a share of body weight (some 3 N)."""
MOMENT_ARM_M = 0.3
"""Standard deviation of the root moment over that of the force."""


@dataclass(frozen=True)
class Observation:
    """Observations of one trial, as the estimator uses them.

    Attributes:
        time: (n,) s, uniform.
        markers: (n, m, 3) m in the order of the skeleton's markers; NaN where not seen.
        marker_sd: (m,) effective standard deviation of each marker coordinate in one frame, m.
        marker_frames: number of neighbouring frames over which these errors are correlated (`marker_errors`).
        q: (n, c) coordinates from which the search starts.
        spacing_s: knot spacing of the splines of its motion (`bandwidth`).
        dynamic: (n,) frames whose ground contacts are all measured.
        ground: the loads on the feet, and the plates that measured them.
        force_sd, moment_sd: effective standard deviations of the root residual, N and N m.
        impact: (n,) factor by which these are larger in each frame (`impacts`).
        displacement_sd_m: (m,) prior standard deviation of each marker's displacement in this trial (`displacement`),
            each axis.
        repeats: factor by which recurring errors have raised all variances (`repeated`).
        skin: patterns that the skin may follow; None: it does not move with the joints.
        frame_products: (k, 3, 3) mean products of the errors of a frame and of the two before it, over their standard
            deviations, for several kinds of errors; None: those of a process with a double pole.
        name: of the trial.
        reported: (n,) frames whose curves are reported, the dynamic ones among them; None: these alone.
        on_ground: (n, 2) whether right and left foot are on the ground, on a plate or not; None: while loaded.
    """

    time: np.ndarray
    markers: np.ndarray
    marker_sd: np.ndarray
    marker_frames: float
    q: np.ndarray
    spacing_s: float
    dynamic: np.ndarray
    ground: FootPlates
    force_sd: float
    moment_sd: float
    impact: np.ndarray | float = 1.0
    displacement_sd_m: np.ndarray | float = 0.0
    repeats: float = 1.0
    skin: SkinPatterns | None = None
    frame_products: np.ndarray | None = None
    name: str = ""
    reported: np.ndarray | None = None
    on_ground: np.ndarray | None = None

    @cached_property
    def curve_frames(self) -> np.ndarray:
        """Indices (d,) of the frames whose curves are reported."""
        return np.flatnonzero(self.dynamic if self.reported is None else self.dynamic | self.reported)

    @cached_property
    def near_windows(self) -> slice:
        """The frames from the first to the last dynamic one and just around them; all if there is none."""
        dynamic = np.flatnonzero(self.dynamic)
        if not dynamic.size:
            return slice(0, len(self.time))
        start, end = self.time[dynamic[[0, -1]]]
        near = np.flatnonzero(within(self.time, start - AROUND_WINDOW_S, end + AROUND_WINDOW_S))
        return slice(int(near[0]), int(near[-1]) + 1)

    @cached_property
    def marker_process(self) -> tuple[np.ndarray, ErrorProcess]:
        """Standard deviations (m,) of the markers' errors, m, and the process that they follow from frame to frame."""
        if self.frame_products is None:
            return self.marker_sd, ErrorProcess.double_over(self.marker_frames)
        process, variance = ErrorProcess.read(self.marker_frames, self.frame_products)
        return np.sqrt(variance) * self.marker_sd, process

    def root_sd(self, frames: np.ndarray) -> np.ndarray:
        """Return standard deviations (d, 6) of the root residual in these frames: N, N m."""
        larger = np.broadcast_to(self.impact, len(self.time))[frames]
        return np.outer(larger, np.repeat([self.force_sd, self.moment_sd], 3))

    def repeated(self, times: float) -> Self:
        """Return the observation with standard deviations for errors that recur so many times in the estimate's data.

        Larger standard deviations leave more room for the innovation of a frame, the cameras' noise: it does not recur.
        """
        more = np.sqrt(times)
        return replace(
            self,
            marker_sd=more * self.marker_sd,
            force_sd=more * self.force_sd,
            moment_sd=more * self.moment_sd,
            repeats=times * self.repeats,
            frame_products=None if self.frame_products is None else self.frame_products / times,
        )


@dataclass(frozen=True)
class CalibrationPrior:
    """Prior standard deviations of the calibration, whose mean is the skeleton as it is.

    Attributes:
        coordinates: static coordinate (locked in the skeleton) -> standard deviation, rad or m.
        marker_sd_m: (m,) of each marker's position in its segment, each axis.
        instruments: priors of plates and synchronisation.
        before: static coordinate -> its value before the trials changed it; for others the skeleton's.
        fixed_axes: static coordinate that tilts an axis and is no unknown -> standard deviation, rad.
    """

    coordinates: Mapping[str, float]
    marker_sd_m: np.ndarray
    instruments: InstrumentPrior
    before: Mapping[str, float] = field(default_factory=dict)
    fixed_axes: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations of the trials of one person.

    Attributes:
        separate: per trial, with the standard deviations of errors that never recur.
        noise: per trial.
        misplaced_m: (m,) standard deviation of the markers' mean positions in their segments, over the trials, from the
            skeleton's.
        repeats: (t, t) how often the errors of each trial recur in each (`marker_noise.repeats`).
    """

    separate: tuple[Observation, ...]
    noise: tuple[MarkerNoise, ...]
    misplaced_m: np.ndarray
    repeats: np.ndarray

    @cached_property
    def pooled(self) -> tuple[Observation, ...]:
        """Observations of the trials for one estimate from all of them: errors that recur count once."""
        return tuple(o.repeated(count) for o, count in zip(self.separate, self.repeats.sum(axis=1), strict=True))


def observe(
    skeleton: Skeleton, trials: Sequence[Kinematics], mass_kg: float, bandwidths: Sequence[Bandwidth]
) -> Observations:
    """Extract the observations of a person's trials, and the noise of their markers.

    Args:
        skeleton: with exactly the markers to use, in the order of the observations; a trial may lack some.
        trials: kinematics of each.
        mass_kg: for the size of force errors.
        bandwidths: per trial, of motion and forces.
    """
    errors = [_errors(skeleton, trial) for trial in trials]
    rates = [trial.trial.markers.rate_hz for trial in trials]
    skin = skin_patterns(
        skeleton, [error.smooth for error in errors], [bool(trial.trial.loads.plates) for trial in trials]
    )
    usual = [root_mean_square(error.varying) for error in errors]
    frames = [correlated_frames(error.varying, sd) for error, sd in zip(errors, usual, strict=True)]
    places = np.stack([error.displaced for error in errors])
    rest = WithoutSkin.of([error.varying for error in errors], places, skin, frames)
    pairs = [
        _observed(skeleton, trial, bandwidth, *marked, mass_kg)
        for trial, bandwidth, marked in zip(
            trials, bandwidths, zip(errors, rest.varying, skin, frames, strict=True), strict=True
        )
    ]
    displaced = _displacement_sd(skeleton, rest.displaced)
    # errors that the estimate finds to follow the joints recur, too: they count as often as before they were found, and
    # where root equations hold, whose errors recur with them: other strides of the markers repeat no force
    alike = [
        repeats([weighed(e, o.marker_sd)[o.near_windows] for e, (o, _) in zip(every, pairs, strict=True)], rates)
        for every in ([error.varying for error in errors], rest.varying)
    ]
    counts = np.maximum(*alike)
    by_label = dict(zip(skeleton.labels, map(float, displaced), strict=True))
    noise = [
        replace(
            noise_of_trial,
            repeats=float(count),
            displacement_sd_m={label: by_label[label] for label in noise_of_trial.sd_m},
        )
        for (_, noise_of_trial), count in zip(pairs, counts.sum(axis=1), strict=True)
    ]
    pooled = tuple(replace(o, displacement_sd_m=displaced) for o, _ in pairs)
    return Observations(pooled, tuple(noise), _misplaced(skeleton, rest.displaced), counts)


def _displacement_sd(skeleton: Skeleton, displaced: np.ndarray) -> np.ndarray:
    """Return the SD (m,) over trials of marker positions in their segments (t, m, 3), segment by segment.

    Positions are NaN where a trial does not show a marker. The result is zero for a single trial.
    """
    count = np.isfinite(displaced).sum(axis=0)
    apart = np.nan_to_num(displaced - _middle(displaced))
    return _spread(skeleton, apart, np.maximum(count - 1, 0))


def _misplaced(skeleton: Skeleton, displaced: np.ndarray) -> np.ndarray:
    """Return the SD (m,) of the mean positions of markers (t, m, 3) from the skeleton's, segment by segment."""
    shown = np.isfinite(displaced).any(axis=0)
    return _spread(skeleton, _middle(displaced)[None], shown.astype(int))


def _middle(displaced: np.ndarray) -> np.ndarray:
    """Return the mean (m, 3) over trials (t, m, 3), ignoring NaN; zero where all are NaN."""
    result: np.ndarray = np.nansum(displaced, axis=0) / np.maximum(np.isfinite(displaced).sum(axis=0), 1)
    return result


def _spread(skeleton: Skeleton, apart: np.ndarray, freedom: np.ndarray) -> np.ndarray:
    """Return the RMS (m,) of distances (t, m, 3) with these degrees of freedom (m, 3), segment by segment.

    It is the same for all markers of a segment, except for the number of markers with common errors.
    """
    alike = markers_in_common(skeleton, apart)
    result = np.zeros(len(alike))
    for segment in np.unique(skeleton.marker_segments):
        of_segment = skeleton.marker_segments == segment
        if freedom[of_segment].any():
            result[of_segment] = np.sqrt(
                alike[of_segment] * np.square(apart[:, of_segment]).sum() / freedom[of_segment].sum()
            )
    return result


@dataclass(frozen=True, eq=False)
class _Errors:
    """Residuals of inverse kinematics in one trial.

    Attributes:
        time: (n,) s, uniform: `Kinematics.span_s`.
        frames: (n,) their indices among the marker frames.
        q: (n, c) coordinates; bridged where the root was not seen.
        measured: (n, m, 3) markers, m; NaN where not seen.
        displaced: (m, 3) mean of measured minus model, in the axes of each marker's segment.
        varying: (n, m, 3) the rest.
        smooth: (n, c) coordinates without noise, none missing.
    """

    time: np.ndarray
    frames: np.ndarray
    q: np.ndarray
    measured: np.ndarray
    displaced: np.ndarray
    varying: np.ndarray
    smooth: np.ndarray


def _errors(skeleton: Skeleton, kinematics: Kinematics) -> _Errors:
    time = kinematics.trial.markers.time
    near = within(time, *kinematics.span_s)
    solved = np.isfinite(kinematics.ik.q).any(axis=1)
    frames = np.flatnonzero(near & np.logical_or.accumulate(solved) & np.logical_or.accumulate(solved[::-1])[::-1])
    # frames between must stay, so that neighbouring frames remain neighbours; their markers show no pose
    solved = solved[frames]
    bridged = kinematics.spline(time[frames])
    q = np.where(solved[:, None], kinematics.ik.q[frames], bridged)
    measured = kinematics.trial.markers.arranged(skeleton.labels)[frames]
    measured[~solved] = np.nan
    known = np.where(np.isfinite(q), q, bridged)
    local, total, count = np.empty_like(measured), np.zeros(measured.shape[1:]), np.zeros(measured.shape[1:])
    for some in pieces(len(known)):
        pose = skeleton.pose(known[some])
        turned = pose.rotation[:, skeleton.marker_segments].transpose(0, 1, 3, 2)
        local[some] = (turned @ (measured[some] - skeleton.marker_positions(pose))[..., None])[..., 0]
        total += np.nansum(local[some], axis=0)
        count += np.isfinite(local[some]).sum(axis=0)
    # the mean offset of a marker from its position in the segment is calibration, not noise
    displaced = total / np.where(count > 0, count, np.nan)
    local -= displaced
    return _Errors(time[frames], frames, q, measured, displaced, local, bridged)


def _observed(
    skeleton: Skeleton,
    kinematics: Kinematics,
    bandwidth: Bandwidth,
    errors: _Errors,
    rest: np.ndarray,
    skin: SkinPatterns,
    frames: float,
    mass_kg: float,
) -> tuple[Observation, MarkerNoise]:
    """Extract the observation of one trial on its own, and its marker noise."""
    time, trial = errors.time, kinematics.trial
    taken = taken_by_chance(np.isfinite(rest[..., 0]).sum(axis=0), skin.last - skin.first, frames)
    noise, effective, alike, products = marker_noise(skeleton, rest, taken, trial.markers.rate_hz)
    shown = np.isfinite(errors.displaced).all(axis=1)
    virtual = np.array([trial.virtual_sd_m.get(label, 0.0) for label in skeleton.labels])
    effective = np.sqrt(np.square(effective) + girdle_variance(skeleton, errors.smooth, shown) + np.square(virtual))
    # within the band, neighbouring frames are redundant
    repeated = np.sqrt(max(1.0, trial.markers.rate_hz / (2.0 * bandwidth.motion_hz)))
    force_sd = repeated * FORCE_SD_OF_WEIGHT * mass_kg * GRAVITY_M_S2
    ground = _ground(kinematics, time, bandwidth.motion_hz, bandwidth.force)
    dynamic = kinematics.inside(time) & (bool(trial.loads.plates) and kinematics.complete)
    force = ground.loads(time).reshape(-1, 2, 6)[..., :3].sum(axis=1)
    weight_n = mass_kg * GRAVITY_M_S2
    impact = impact_factors(time, force, dynamic, bandwidth.spacing_s, force_sd)
    swing = swing_factors(time, force, dynamic, weight_n, FORCE_SD_OF_WEIGHT * weight_n)
    return (
        Observation(
            time=time,
            markers=errors.measured,
            marker_sd=effective,
            marker_frames=alike,
            q=errors.q,
            spacing_s=bandwidth.spacing_s,
            dynamic=dynamic,
            ground=ground,
            force_sd=force_sd,
            moment_sd=MOMENT_ARM_M * force_sd,
            impact=np.sqrt(np.square(impact) + np.square(swing) - 1.0),
            skin=skin,
            frame_products=products,
            name=trial.name,
            reported=kinematics.known_frames[errors.frames] & bool(trial.loads.plates),
            on_ground=None if trial.on_ground is None else trial.on_ground[errors.frames],
        ),
        noise,
    )


def reading(observation: Observation, kinematics: Kinematics, bandwidth: Bandwidth) -> Observation:
    """Return the observation with the ground reactions of these kinematics, otherwise the same."""
    ground = _ground(kinematics, observation.time, bandwidth.motion_hz, bandwidth.force)
    return replace(observation, ground=ground)


def _ground(kinematics: Kinematics, time: np.ndarray, cutoff_hz: float, force_cutoff: ForceCutoff) -> FootPlates:
    loads = kinematics.trial.loads
    turn = Rotation.from_euler("y", kinematics.turned_deg, degrees=True).as_matrix()
    reactions = ground_reactions(kinematics, cutoff_hz, force_cutoff)
    at_frames = loads.plate_index[nearest_samples(loads.time, time)]
    used, places = np.unique(np.concatenate([at_frames, reactions.plate_index]), return_inverse=True)
    places = places.reshape(-1, 2)
    return FootPlates(
        kinematics.smoothed_loads(cutoff_hz),
        smooth(reactions.time, reactions.loaded, cutoff_hz),
        replace(reactions, plate_index=places[len(time) :]),
        tuple(loads.plates[i] for i in used) if loads.plates else (),
        places[: len(time)],
        turn,
        plate_middles(loads, used),
    )
