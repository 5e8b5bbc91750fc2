"""Turns a trial into smooth coordinates: heading +X, inverse kinematics, splines, matching ground reactions.

All coordinates and the ground reactions have the same cutoff, chosen by `kinertia.motion.common_cutoff`. With a cutoff
for each coordinate, the effects of one skin motion on pelvis and hips no longer cancel: the residual of the Rajagopal
walk was 53 N with cutoffs of 10 to 15 Hz, 42 N with 10 for all and 48 N with 12.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from kinertia.errors import MarkerSetError, TrialError
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.motion.common_cutoff import Cutoff, common_cutoff
from kinertia.motion.dynamics import Motion
from kinertia.motion.inverse_kinematics import InverseKinematics, solve_ik
from kinertia.motion.smoothing import SmoothedSpline, SmoothingError, interpolate, smooth
from kinertia.motion.workload import one_blas_thread
from kinertia.trial.data import LOAD_THRESHOLD_N, Markers, Trial
from kinertia.trial.foot_motion import AROUND_LOAD_S
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s, within

LONGEST_BRIDGE_S = 0.1
"""The spline may bridge a coordinate that the visible markers do not determine for at most this long."""
FEWEST_FRAMES = 11
"""Fewest frames of a window."""
AROUND_WINDOW_S = AROUND_LOAD_S
"""Samples this near the measured window help to determine the motion at its ends."""
AROUND_CONTACT_S = 0.5
"""Joint moments are reported up to this long before and after a contact with a plate: most of a swing phase."""
END_PERIODS = 0.5
"""Measured windows are this share of the cutoff's period off the ends of the record, where accelerations are poor.

On the gait2354 walk the residual is 57 N in these frames and 35 N in all others. Joint loads are known there, too, with
longer error bars.
"""

_FRAMES_BESIDE = 20
"""A natural quintic spline forgets samples farther away: each divides their weight by 2.3."""
_LEAST_FREEDOM = 1e-6


@dataclass(frozen=True, eq=False)
class Kinematics:
    """A trial with its coordinates.

    Attributes:
        trial: rotated so that the person faces +X.
        turned_deg: angle of that rotation, about the vertical.
        ik: coordinates frame by frame.
        spline: smoothed coordinates over the frames that inverse kinematics solved.
        cutoff_hz: of the coordinates and the ground reactions.
        windows_s: first and last time of every window in which all ground contact is measured and all coordinates are
            known, with accelerations; in order.
        complete: whether all ground contact is measured in `windows_s`; if not, these are the stances of a leg that is
            on a plate, there are no residuals, and only what `known` says is known.
        known: (n, c) marker frames in which the generalised force of each coordinate can be known (`known_forces`).
        notes: assumptions made so far.
        findings: which frames are used, and where inverse kinematics did not converge; the trial has its own findings.
    """

    trial: Trial
    turned_deg: float
    ik: InverseKinematics
    spline: SmoothedSpline
    cutoff_hz: float
    windows_s: tuple[tuple[float, float], ...]
    notes: tuple[str, ...]
    findings: tuple[Finding, ...]
    known: np.ndarray
    complete: bool

    @property
    def window_s(self) -> tuple[float, float]:
        """First time of the first and last time of the last measured window."""
        return self.windows_s[0][0], self.windows_s[-1][1]

    def inside(self, time: np.ndarray) -> np.ndarray:
        """Return the mask of times (n,) that lie in a measured window."""
        return inside(time, self.windows_s)

    @cached_property
    def frames(self) -> np.ndarray:
        """Indices of the marker frames inside the measured windows."""
        return np.flatnonzero(self.inside(self.trial.markers.time))

    @cached_property
    def time(self) -> np.ndarray:
        """Times (w,) s of the frames inside the measured windows."""
        result: np.ndarray = self.trial.markers.time[self.frames]
        return result

    @cached_property
    def known_frames(self) -> np.ndarray:
        """Mask (n,) of the marker frames in which the generalised force of any coordinate is known."""
        inside = self.inside(self.trial.markers.time) & self.complete
        result: np.ndarray = inside | self.known.any(axis=1)
        return result

    @cached_property
    def trajectory_frames(self) -> slice:
        """The f marker frames from the first to the last one in `known_frames`."""
        frames = np.flatnonzero(self.known_frames)
        return slice(int(frames[0]), int(frames[-1]) + 1)

    @property
    def trajectory_time(self) -> np.ndarray:
        """Times (f,) s of `trajectory_frames`."""
        return self.trial.markers.time[self.trajectory_frames]

    @property
    def trajectory_known(self) -> np.ndarray:
        """Mask (f, c) of `trajectory_frames` in which the generalised force of each coordinate is known."""
        inside = self.inside(self.trajectory_time)[:, None] & self.complete
        result: np.ndarray = self.known[self.trajectory_frames] | inside
        return result

    @cached_property
    def span_s(self) -> tuple[float, float]:
        """First and last time of the samples that determine the motion: of `trajectory_frames` and around them."""
        (start, end), time = self.window_s, self.trajectory_time
        ends_s = END_PERIODS / self.cutoff_hz
        first, last = min(start - AROUND_WINDOW_S, time[0] - ends_s), max(end + AROUND_WINDOW_S, time[-1] + ends_s)
        return float(first), float(last)

    def with_smooth_ends(self, q: np.ndarray, cutoff_hz: float) -> np.ndarray:
        """Smooth coordinates (f, c) at `trajectory_time` near the first and the last pose that markers show.

        No marker says how a spline goes on beyond: its accelerations there are mostly noise, and those of a natural
        smoothing spline of the same bandwidth a third as wrong. Measured windows stay as they are; the farther away
        from them a frame is, the more it may change.
        """
        time, ends = self.trajectory_time, self.spline.time[[0, -1]]
        inwards = np.abs(time[:, None] - ends).min(axis=1) * self.cutoff_hz / END_PERIODS
        freedom = np.square(np.maximum(1.0 - inwards, 0.0))
        result = q.copy()
        for first, last in runs(freedom > _LEAST_FREEDOM):
            part = slice(max(first - _FRAMES_BESIDE, 0), last + 1 + _FRAMES_BESIDE)
            result[part] = _smoothed(time[part], q[part], freedom[part], cutoff_hz)
        return result

    @cached_property
    def intervals(self) -> tuple[slice, ...]:
        """Slices of the w frames, one per measured window."""
        starts = np.searchsorted(self.time, [start - TIME_TOLERANCE_S for start, _ in self.windows_s])
        return tuple(slice(a, b) for a, b in pairwise([*starts.tolist(), len(self.time)]))

    @cached_property
    def motion(self) -> Motion:
        """Smoothed coordinates and derivatives inside the measured windows."""
        return Motion(*(self.spline(self.time, order) for order in range(3)))

    @cached_property
    def foot_loads(self) -> np.ndarray:
        """Ground reactions (w, 2, 6) on right and left foot in the windows: force, moment about the ground origin."""
        return self.smoothed_loads(self.cutoff_hz)(self.time).reshape(-1, 2, 6)

    def smoothed_loads(self, cutoff_hz: float) -> SmoothedSpline:
        """Return ground reactions (12: right force and moment, left force and moment) as functions of time.

        Samples between the windows and around them are used: a plate may not have measured all ground contact there,
        but its load still continues.
        """
        loads, near = self.trial.loads, self.near_window
        return smooth(loads.time[near], loads.wrench[near].reshape(-1, 12), cutoff_hz)

    @cached_property
    def near_window(self) -> np.ndarray:
        """Mask (k,) of samples of the ground reactions in `span_s`."""
        return within(self.trial.loads.time, *self.span_s)


def _smoothed(time: np.ndarray, values: np.ndarray, freedom: np.ndarray, cutoff_hz: float) -> np.ndarray:
    """Smooth samples (n, c) by a natural quintic spline that passes through those whose freedom (n,) is 0.

    It minimises the sum of squared changes over freedom and p times the integral of its squared third derivative, with
    the p of `kinertia.motion.smoothing`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact, since the integrand has degree 4
    steps, free = np.diff(time)[:, None], freedom > _LEAST_FREEDOM
    at = (time[:-1, None] + steps * (nodes + 1.0) / 2.0).ravel()
    third = interpolate(time, np.eye(len(time)))(at, 3) * np.sqrt(steps * weights / 2.0).reshape(-1, 1)
    by_free, inverse_p = third[:, free], float(steps.mean()) * (2.0 * np.pi * cutoff_hz) ** 6
    result = values.copy()
    system = by_free.T @ by_free + np.diag(inverse_p / freedom[free])
    result[free] -= np.linalg.solve(system, by_free.T @ third @ values)
    return result


def inside(time: np.ndarray, windows_s: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return the mask of times (n,) that lie in one of the windows (first and last time, s)."""
    result = np.zeros(np.shape(time), dtype=bool)
    for first, last in windows_s:
        result |= within(time, first, last)
    return result


def facing(markers: Markers, marker_set: MarkerSet) -> tuple[np.ndarray, float]:
    """Return the rotation about the vertical, a multiple of 90 degrees, that makes the person face +X; and its angle.

    Raises:
        MarkerSetError: the markers of the ASIS are not in the trial, or never visible together.
    """
    sides = [markers.select(marker_set.landmarks[f"asis_{side}"]).positions.mean(axis=1) for side in "rl"]
    across = sides[0] - sides[1]
    across = across[np.isfinite(across[:, 0])]
    if not len(across):
        labels = [label for side in "rl" for label in marker_set.landmarks[f"asis_{side}"]]
        raise MarkerSetError(
            f"no frame shows the markers {' and '.join(labels)} together, so it is unknown which way the person faces; "
            f"use a trial that does",
            labels,
        )
    right = across.mean(axis=0)
    quarter = int(np.round(np.arctan2(right[0], right[2]) / (np.pi / 2)))
    cosine, sine = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter % 4]
    return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]]), -90.0 * quarter


@one_blas_thread
def solve_kinematics(
    skeleton: Skeleton, trial: Trial, turned_deg: float, smoothing: float | Literal["gcv"]
) -> Kinematics:
    """Apply inverse kinematics and smoothing to a trial that already faces +X.

    Raises:
        TrialError: R102, R103, a coordinate is known in too few frames to be smoothed, or in none; R104, P279, no
            frame, or too few, with complete ground contact and all coordinates; R102, if the trial has no forces.
    """
    ik = solve_ik(skeleton, trial.markers, trial.name)
    solved = np.flatnonzero(np.isfinite(ik.q).any(axis=1))
    shown = slice(solved[0], solved[-1] + 1)
    try:
        cutoff = common_cutoff(ik.time[shown], ik.q[shown, :3], trial) if smoothing == "gcv" else Cutoff(smoothing)
        spline = smooth(ik.time[shown], ik.q[shown], cutoff.hz)
    except SmoothingError as error:
        part = Where(part=ik.coordinates[error.column])
        code = "R102" if error.n_visible else "R103"
        raise TrialError.found(trial.name, code, part, frames=Quantity(error.n_visible, "1")) from error
    seen = _bridged(np.isfinite(ik.q), ik.time)
    inner = seen & _away_from_ends(ik.time, shown, END_PERIODS / cutoff.hz)[:, None]
    whole = np.logical_and.reduce(inner, axis=1)
    known, usable = known_forces(skeleton, trial, seen), whole & trial.measured
    complete = _longest(usable) >= FEWEST_FRAMES or not _longest(legs_on_plates(trial)) >= FEWEST_FRAMES
    if not complete:
        usable = legs_on_plates(trial) & _of_a_leg(skeleton, known_forces(skeleton, trial, inner))
    windows, findings = _long_enough(trial, usable, whole)
    stuck = int((~ik.converged[solved]).sum())
    if stuck:
        findings.append(finding("R105", Where(trial=trial.name), frames=Quantity(stuck, "1")))
    remarks = [f"{trial.name}: {cutoff.sentence}"] if cutoff.sentence else []
    notes = (*trial.notes, *remarks)
    return Kinematics(trial, turned_deg, ik, spline, cutoff.hz, windows, notes, tuple(findings), known, complete)


def _away_from_ends(time: np.ndarray, shown: slice, ends_s: float) -> np.ndarray:
    """Return the mask (n,) of frames at least `ends_s` within the first and the last of the frames shown."""
    middle_s, half_s = time[shown].mean(), np.ptp(time[shown]) / 2
    result: np.ndarray = np.abs(time - middle_s) <= half_s - ends_s + TIME_TOLERANCE_S
    return result


def _of_a_leg(skeleton: Skeleton, known: np.ndarray) -> np.ndarray:
    """Return the mask (n,) of frames in which all forces (n, c) of either leg are known."""
    result = np.zeros(len(known), dtype=bool)
    for foot in skeleton.feet:
        owners = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(foot)]])
        result |= np.logical_and.reduce(known[:, owners[owners >= len(skeleton.joints[0].axes)]], axis=1)
    return result


def legs_on_plates(trial: Trial) -> np.ndarray:
    """Return the mask (n,) of marker frames in which a leg stands on a plate that measures all its load."""
    if trial.leg_known is None:
        return np.zeros(len(trial.markers.time), dtype=bool)
    nearest = nearest_samples(trial.loads.time, trial.markers.time)
    loaded = trial.loads.force[nearest, :, 1] >= LOAD_THRESHOLD_N
    result: np.ndarray = np.logical_or.reduce(trial.leg_known & loaded, axis=1)
    return result


def _longest(mask: np.ndarray) -> int:
    return max((last - first + 1 for first, last in runs(mask)), default=0)


def known_forces(skeleton: Skeleton, trial: Trial, seen: np.ndarray) -> np.ndarray:
    """Return the mask (n, c) of marker frames in which the generalised force of each coordinate can be known.

    It needs only what is distal to the coordinate: the motion of these segments, and the loads on the feet among them.
    A leg on its plate, or in the air, is enough for the joints of this leg; trunk and arms need no plate. The pelvis'
    own coordinates need everything and are known in the measured windows only, which this mask does not include.
    Frames more than AROUND_CONTACT_S from any contact with a plate are left out.

    Args:
        skeleton: the model.
        trial: with the frames in which the load on each leg is known.
        seen: (n, c) whether markers show each coordinate, with accelerations.
    """
    of_axes = np.equal.outer(skeleton.map.owner, np.arange(len(skeleton.coordinates)))
    moves = skeleton.support.astype(int) @ of_axes > 0
    needed = moves.T.astype(int) @ moves > 0  # coordinates that move any segment that this one moves
    known = np.stack([seen[:, axes].all(axis=1) for axes in needed], axis=1)
    for foot, segment in enumerate(skeleton.feet):
        known[:, moves[skeleton.segments.index(segment)]] &= trial.known_legs[:, foot, None]
    known[:, : len(skeleton.joints[0].axes)] = False  # the measured windows are added to it
    result: np.ndarray = known & near_contacts(trial)[:, None]
    return result


def near_contacts(trial: Trial) -> np.ndarray:
    """Return the mask (n,) of marker frames at most AROUND_CONTACT_S from a foot's contact with a plate."""
    time, loaded = trial.loads.time, (trial.loads.force[:, :, 1] >= LOAD_THRESHOLD_N).any(axis=1)
    if not loaded.any():
        return np.zeros(len(trial.markers.time), dtype=bool)
    contact = time[loaded]
    nearest = contact[nearest_samples(contact, trial.markers.time)] if len(contact) > 1 else contact
    result: np.ndarray = np.abs(nearest - trial.markers.time) <= AROUND_CONTACT_S + TIME_TOLERANCE_S
    return result


def _bridged(known: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Fill gaps of up to LONGEST_BRIDGE_S between known frames in `known` (n, c)."""
    filled = known.copy()
    for c in range(known.shape[1]):
        for first, last in runs(~known[:, c]):
            inner = first > 0 and last < len(time) - 1
            if inner and span_s(time, first - 1, last + 1) <= LONGEST_BRIDGE_S:
                filled[first : last + 1, c] = True
    return filled


def _long_enough(
    trial: Trial, usable: np.ndarray, known: np.ndarray
) -> tuple[tuple[tuple[float, float], ...], list[Finding]]:
    """Return first and last time of the windows of usable frames (n,) that are long enough, and findings.

    P270 if there are several, or some are left out.
    """
    time, where = trial.markers.time, Where(trial=trial.name)
    windows = runs(usable)
    used = [(first, last) for first, last in windows if last - first + 1 >= FEWEST_FRAMES]
    if not used and not trial.loads.plates:
        whole = Where(part="the whole body")
        raise TrialError.found(trial.name, "R102", whole, frames=Quantity(int(known.sum()), "1"))
    if not windows:
        measured, shown = (Quantity(int(mask.sum()), "1") for mask in (trial.measured, known))
        raise TrialError.found(trial.name, "R104", frames_with_contact=measured, frames_with_markers=shown)
    if not used:
        first, last = max(windows, key=lambda run: run[1] - run[0])
        longest = Where(span_s=(float(time[first]), float(time[last])))
        few = Quantity(last - first + 1, "1", limit=FEWEST_FRAMES)
        raise TrialError.found(trial.name, "P279", longest, frames=few)
    frames = sum(last - first + 1 for first, last in used)
    left_out = sum(last - first + 1 for first, last in windows) - frames
    found = []
    if len(windows) > 1:
        found = [
            finding(
                "P270",
                where,
                frames=Quantity(frames, "1"),
                count=Quantity(len(used), "1"),
                left_out=Quantity(left_out, "1"),
            )
        ]
    return tuple((float(time[first]), float(time[last])) for first, last in used), found
