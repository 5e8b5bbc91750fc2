"""What the simultaneous estimate sees of a measured trial: its frames, its smoothed loads, and how noisy its markers
are.

Marker noise is not white: skin motion lasts for many frames. Its deviation and correlation length
are read from the errors that inverse kinematics leaves; the estimate takes it as a first-order autoregressive process
(`marker_terms`). The deviation is inflated by the square root of the number of markers that err alike: those of a
segment ride on the same skin. So are all deviations where errors come back (`repetition`). Inverse kinematics absorbs
part of the noise; the deviation makes up for its degrees of freedom only on average.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.estimation.simultaneous.bandwidth import Bandwidth
from kinertia.estimation.simultaneous.plates import FootPlates
from kinertia.estimation.simultaneous.problem import Observation
from kinertia.estimation.simultaneous.repetition import Repetition, repeats
from kinertia.model.skeleton import GRAVITY_M_S2, Skeleton
from kinertia.motion.ground_reactions import ground_reactions
from kinertia.motion.kinematics import AROUND_WINDOW_S, Kinematics
from kinertia.settings import ForceCutoff
from kinertia.trial.data import nearest_samples

FORCE_SD_OF_WEIGHT = 0.005
"""Deviation of the root force from that of rigid segments, share of body weight (some 3 N)."""
MOMENT_ARM_M = 0.3
"""Deviation of the root moment over that of the force."""
SMALLEST_MARKER_SD_M = 0.001
_WANDERING = 3.0
CORNER = 2.0
"""Skin motion has a nearly flat spectrum up to its highest frequency; that of a first-order process as strong and as
long falls before. One with so many times its bandwidth, as dense at zero frequency, is two thirds as dense there. Less
makes measured people odder and their residuals larger, more makes joint moments vaguer than they are."""


@dataclass(frozen=True)
class MarkerNoise:
    """Errors of the markers of one trial.

    Attributes:
        sd_m: per label, deviation of one coordinate in one frame, m.
        correlation_s: time over which errors are alike.
        wandering: labels whose deviation is more than three times the usual; they drift and are down-weighted.
        repeats: in how many strides of all trials together they are alike (`repetition`); 1: they never come back.
        displacement_sd_m: per label, deviation of its displacement in this trial (`displacement`), m; 0 for one trial.
    """

    sd_m: Mapping[str, float]
    correlation_s: float
    wandering: tuple[str, ...]
    repeats: float = 1.0
    displacement_sd_m: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Observations:
    """Trials of one person.

    Attributes:
        alone: per trial, with the deviations of errors that never come back.
        noise: per trial.
        repeats: (t, t) how often the errors of each trial come back in each (`repetition.repeats`).
    """

    alone: tuple[Observation, ...]
    noise: tuple[MarkerNoise, ...]
    repeats: np.ndarray

    @property
    def together(self) -> tuple[Observation, ...]:
        """The trials for one estimate from all: what comes back counts once."""
        return tuple(o.repeated(count) for o, count in zip(self.alone, self.repeats.sum(axis=1), strict=True))


def observe(
    skeleton: Skeleton, trials: Sequence[Kinematics], mass_kg: float, bandwidth: Bandwidth, staying: bool = False
) -> Observations:
    """The observations of trials of one person, and the noise of their markers.

    Args:
        skeleton: with exactly the markers to use, in the order of the observations; a trial may lack some.
        trials: kinematics of each.
        mass_kg: for the size of force errors.
        bandwidth: of motion and forces.
        staying: markers stay where the skeleton has them, in all trials: no displacements.
    """
    errors = [_errors(skeleton, each) for each in trials]
    found = [_observed(skeleton, k, each, mass_kg, bandwidth) for k, each in zip(trials, errors, strict=True)]
    places = np.stack([each.displaced for each in errors])
    displaced = np.zeros(places.shape[1]) if staying else _displacement_sd(skeleton, places)
    varying = [_columns(each.varying, o.marker_sd) for each, (o, _) in zip(errors, found, strict=True)]
    counts = repeats(varying, [each.trial.markers.rate_hz for each in trials])
    by_label = dict(zip(skeleton.labels, map(float, displaced), strict=True))
    noise = [
        replace(one, repeats=float(count), displacement_sd_m={label: by_label[label] for label in one.sd_m})
        for (_, one), count in zip(found, counts.sum(axis=1), strict=True)
    ]
    return Observations(tuple(replace(o, displacement_sd_m=displaced) for o, _ in found), tuple(noise), counts)


def _displacement_sd(skeleton: Skeleton, displaced: np.ndarray) -> np.ndarray:
    """(m,) deviation over trials of where markers are in their segments (t, m, 3), segment by segment; NaN where a
    trial does not show them. Zero for a single trial.
    """
    seen = np.isfinite(displaced)
    count = seen.sum(axis=0)
    middle = np.where(seen, displaced, 0.0).sum(axis=0) / np.maximum(count, 1)
    apart = np.where(seen, displaced - middle, 0.0)
    alike = _alike(skeleton, apart)
    result = np.zeros(len(alike))
    for segment in np.unique(skeleton.marker_segments):
        own = skeleton.marker_segments == segment
        freedom = np.maximum(count[own] - 1, 0).sum()
        if freedom:
            result[own] = np.sqrt(alike[own] * np.square(apart[:, own]).sum() / freedom)
    return result


@dataclass(frozen=True, eq=False)
class _Errors:
    """What inverse kinematics leaves of one trial.

    Attributes:
        time: (n,) s, uniform: the window and its surroundings.
        q: (n, c) coordinates; bridged where the root was not seen.
        measured: (n, m, 3) markers, m; NaN where not seen.
        displaced: (m, 3) mean of measured minus model, in the axes of each marker's segment.
        varying: (n, m, 3) the rest.
    """

    time: np.ndarray
    q: np.ndarray
    measured: np.ndarray
    displaced: np.ndarray
    varying: np.ndarray


def _errors(skeleton: Skeleton, kinematics: Kinematics) -> _Errors:
    time = kinematics.trial.markers.time
    start, end = kinematics.window_s
    near = (time >= start - AROUND_WINDOW_S - 1e-9) & (time <= end + AROUND_WINDOW_S + 1e-9)
    solved = np.isfinite(kinematics.ik.q).any(axis=1)
    frames = np.flatnonzero(near & np.logical_or.accumulate(solved) & np.logical_or.accumulate(solved[::-1])[::-1])
    # frames between must stay, or neighbours would not be neighbours; their markers show no pose
    solved = solved[frames]
    bridged = kinematics.spline(time[frames])
    q = np.where(solved[:, None], kinematics.ik.q[frames], bridged)
    measured = kinematics.trial.markers.arranged(skeleton.labels)[frames]
    measured[~solved] = np.nan
    known = np.where(np.isfinite(q), q, bridged)
    pose = skeleton.pose(known)
    errors = measured - skeleton.marker_positions(pose)
    turned = pose.rotation[:, skeleton.marker_segments].transpose(0, 1, 3, 2)
    local = (turned @ errors[..., None])[..., 0]
    # what a marker is off its place in the segment all the time is calibration, not noise
    shown = np.isfinite(local).any(axis=0)
    displaced = np.where(shown, np.nanmean(np.where(shown, local, 0.0), axis=0), np.nan)
    return _Errors(time[frames], q, measured, displaced, local - displaced)


def _observed(
    skeleton: Skeleton, kinematics: Kinematics, errors: _Errors, mass_kg: float, bandwidth: Bandwidth
) -> tuple[Observation, MarkerNoise]:
    """One trial on its own."""
    (start, end), time = kinematics.window_s, errors.time
    noise, effective, autocorrelation = _noise(
        skeleton, errors.varying, len(skeleton.coordinates), kinematics.trial.markers.rate_hz
    )
    # within the band, neighbouring frames repeat one another
    repeated = np.sqrt(max(1.0, kinematics.trial.markers.rate_hz / (2.0 * bandwidth.motion_hz)))
    force_sd = repeated * FORCE_SD_OF_WEIGHT * mass_kg * GRAVITY_M_S2
    return (
        Observation(
            time=time,
            markers=errors.measured,
            marker_sd=effective,
            marker_autocorrelation=autocorrelation,
            q=errors.q,
            dynamic=(time >= start - 1e-9) & (time <= end + 1e-9),
            ground=_ground(kinematics, time, bandwidth.motion_hz, bandwidth.force),
            force_sd=force_sd,
            moment_sd=MOMENT_ARM_M * force_sd,
        ),
        noise,
    )


def _ground(kinematics: Kinematics, time: np.ndarray, cutoff_hz: float, force_cutoff: ForceCutoff) -> FootPlates:
    loads = kinematics.trial.loads
    turn = Rotation.from_euler("y", kinematics.turned_deg, degrees=True).as_matrix()
    reactions = ground_reactions(kinematics, cutoff_hz, force_cutoff)
    at_frames = loads.carrier[nearest_samples(loads.time, time)]
    used, places = np.unique(np.concatenate([at_frames, reactions.carrier]), return_inverse=True)
    places = places.reshape(-1, 2)
    return FootPlates(
        kinematics.smoothed_loads(cutoff_hz),
        replace(reactions, carrier=places[len(time) :]),
        tuple(loads.plates[i] for i in used),
        places[: len(time)],
        turn,
    )


def _noise(
    skeleton: Skeleton, errors: np.ndarray, unknowns: int, rate_hz: float
) -> tuple[MarkerNoise, np.ndarray, float]:
    """Noise of the markers, their effective deviations (m,), and the autocorrelation of one frame with the next, from
    errors (n, m, 3).
    """
    seen = np.isfinite(errors)
    filled = np.where(seen, errors, 0.0)
    count = np.maximum(seen.sum(axis=(0, 2)), 1)
    per_frame = seen.sum() / np.count_nonzero(seen.any(axis=(1, 2)))
    lost = np.sqrt(per_frame / max(per_frame - unknowns, 1.0))
    sd = np.maximum(lost * np.sqrt(np.square(filled).sum(axis=(0, 2)) / count), SMALLEST_MARKER_SD_M)
    frames = Repetition.of(_columns(errors, sd)).frames
    usual = float(np.median(sd))
    labels = [label for label, shown in zip(skeleton.labels, seen.any(axis=(0, 2)), strict=True) if shown]
    deviations = dict(zip(skeleton.labels, map(float, sd), strict=True))
    noise = MarkerNoise(
        {label: deviations[label] for label in labels},
        frames / rate_hz,
        tuple(label for label in labels if deviations[label] > _WANDERING * usual),
    )
    alike = max(1.0, frames / CORNER)
    spread = _alike(skeleton, filled) * frames / alike
    return noise, sd * np.sqrt(spread), (alike - 1.0) / (alike + 1.0)


def _columns(errors: np.ndarray, sd_m: np.ndarray) -> np.ndarray:
    """(n, 3 m) errors over their deviations, as the estimate weighs them: one that wanders must not speak for all."""
    result: np.ndarray = np.nan_to_num(errors / sd_m[:, None]).reshape(len(errors), -1)
    return result


def _alike(skeleton: Skeleton, errors: np.ndarray) -> np.ndarray:
    """(m,) how many markers of each marker's segment err as one, from errors (n, m, 3): 1 if each errs on its own.

    The variance of a sum of k equal errors is k times that of k independent ones.
    """
    count = np.ones(errors.shape[1])
    for segment in np.unique(skeleton.marker_segments):
        own = skeleton.marker_segments == segment
        apart = np.square(errors[:, own]).sum()
        if apart > 0:
            count[own] = max(1.0, float(np.square(errors[:, own].sum(axis=1)).sum() / apart))
    return count
