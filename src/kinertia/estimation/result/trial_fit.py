"""Defines the result of an estimate for one trial, `TrialFit`, with its curves wherever they are known.

A joint's load needs only the loads distal to it: the moments of a leg on its plate, or in the air, are known whatever
the other leg does. What is not known is NaN, never zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self, TypeAlias

import numpy as np

from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.estimation.simultaneous.uncertainty.model_errors import with_drawn_knees
from kinertia.findings.extensions import report_function
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion, inverse_dynamics
from kinertia.motion.gait_cycle import Stride, contact_phases, strides_of
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.joint_moments import BodyJoint, JointMoments, body_joints, joint_moments
from kinertia.motion.kinematics import AROUND_CONTACT_S, Kinematics, near_contacts
from kinertia.trial.data import FEET, LOAD_THRESHOLD_N
from kinertia.trial.sampled_data import nearest_samples, runs, span_s
from kinertia.trial.stances import LegCoverage, leg_coverage
from kinertia.trial.trial_input import GAIT, WITHOUT_STRIDES

if TYPE_CHECKING:
    import pandas as pd


Stage: TypeAlias = tuple[Skeleton, BodySegmentParameters, Motion, GroundReactions]
"""What joint loads are computed from: motion at the frames of `Kinematics.trajectory_time`."""


HIDDEN = "markers do not show the leg"
OUTSIDE = "no forces were recorded"
SHARED = "one plate carries both feet"
PARTLY = "the foot reaches beyond its plate, or something else loads the plate"
BESIDE = "the foot stands beside the plates"
FAR = f"more than {AROUND_CONTACT_S} s from any contact with a plate"
LEFT_OUT = "left out"
_EXTRAPOLATED_S = 0.005
"""Forces are continued so far beyond their first and last sample."""
_SHORTEST_S = 0.03
"""Shorter gaps are not listed."""


@dataclass(frozen=True)
class MomentGap:
    """Time (s) in which the moments of a leg ("r" or "l") are not known, with the reason."""

    side: str
    start_s: float
    end_s: float
    reason: str


@dataclass(frozen=True, eq=False)
class JointCurves:
    """Motion and joint loads at the f frames of `Kinematics.trajectory_time`.

    Attributes:
        time: (f,) s.
        known: (f, c) frames in which the generalised force of each coordinate is known.
        motion: estimated coordinates and derivatives, all frames.
        forces: (f, c) generalised forces per stage ("literature", "estimate"), N m and N; NaN where not known.
        joints: three-dimensional moments and forces per stage; NaN where not known.
        deviations: standard deviations (f, ...) of the estimate, with those of `joints` in the last field; NaN where
            not known; None for one draw.

    Examples:
        >>> curves = fit.trials[0].joint_curves  # fit = kinertia.fit_subject("subject.toml")
        >>> knee = curves.joints["estimate"].moments[:, curves.joints["estimate"].joints.index("knee_r")]
        >>> knee.shape[1], "knee_r_adduction" in curves.joints["estimate"].names
        (3, True)
    """

    time: np.ndarray
    known: np.ndarray
    motion: Motion
    forces: Mapping[str, np.ndarray]
    joints: Mapping[str, JointMoments]
    deviations: CurveDeviations | None

    @property
    def moment_sd(self) -> np.ndarray | None:
        """Standard deviations (f, j, 3) of `joints["estimate"].moments`, N m."""
        return None if self.deviations is None else self.deviations.joints[:, :, 0]

    @property
    def force_sd(self) -> np.ndarray | None:
        """Standard deviations (f, j, 3) of `joints["estimate"].forces`, N."""
        return None if self.deviations is None else self.deviations.joints[:, :, 1]

    @classmethod
    def of(
        cls,
        kinematics: Kinematics,
        motion: Motion,
        stages: Mapping[str, Stage],
        deviations: CurveDeviations | None,
        known: np.ndarray,
    ) -> Self:
        """Compute the loads of every stage.

        Args:
            kinematics: of the trial.
            motion: estimated, at the frames of `trajectory_time`.
            stages: skeleton, parameters, motion at these frames and ground reactions of each.
            deviations: standard deviations at these frames.
            known: (f, c) frames in which the generalised force of each coordinate is known.
        """
        time = kinematics.trajectory_time
        forces, joints = {}, {}
        for name, (skeleton, bsp, moved, reactions) in stages.items():
            loads, known_loads = reactions.at(time), known_joints(skeleton, known)
            forces[name] = np.where(known, inverse_dynamics(skeleton, bsp, moved, loads), np.nan)
            joints[name] = _only(joint_moments(skeleton, bsp, moved, loads), known_loads)
        if deviations is not None:
            masked = {kind: np.where(known, getattr(deviations, kind), np.nan) for kind in ("moments", "powers")}
            three = np.where(known_loads[:, :, None, None], deviations.joints, np.nan)
            deviations = replace(deviations, **masked, joints=three)
        return cls(time, known, motion, forces, joints, deviations)

    def drawn(self, kinematics: Kinematics, stage: Stage, random: np.random.Generator | None) -> JointCurves:
        """Return the curves of a draw of the estimate, with knee geometry drawn if `random` is given, without standard
        deviations."""
        drawn_curves = type(self).of(kinematics, stage[2], {"estimate": stage}, None, self.known)
        loads = drawn_curves.joints["estimate"]
        if random is not None:
            loads = with_drawn_knees(stage[0], body_joints(stage[0]), loads, random)
        return replace(
            drawn_curves, forces={**self.forces, **drawn_curves.forces}, joints={**self.joints, "estimate": loads}
        )


def known_with_forces(skeleton: Skeleton, kinematics: Kinematics, reactions: GroundReactions) -> np.ndarray:
    """Return `Kinematics.trajectory_known` without legs where forces, corrected for their delay, were not recorded.

    Measured windows keep all frames.
    """
    time, known = kinematics.trajectory_time, kinematics.trajectory_known.copy()
    beyond = np.maximum(reactions.time[0] - time, time - reactions.time[-1]) > _EXTRAPOLATED_S
    rows = beyond & ~kinematics.inside(time)
    for foot in skeleton.feet:
        axes = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(foot)]])
        known[np.ix_(rows, axes)] = False
    return known


def known_joints(skeleton: Skeleton, known: np.ndarray) -> np.ndarray:
    """Return the mask (f, j) of frames in which the loads of `body_joints` are known, from that of coordinates (f, c).

    A joint that does not move has the frames of the next ones distal to it.
    """
    joints = body_joints(skeleton)
    result = np.zeros((len(known), len(joints)), dtype=bool)
    for k, joint in enumerate(joints):
        columns = joint.columns(skeleton) or _beyond(skeleton, joint)
        result[:, k] = known[:, columns].all(axis=1) & bool(columns)
    return result


def _beyond(skeleton: Skeleton, joint: BodyJoint) -> list[int]:
    """Return the coordinates of joints distal to a joint."""
    child = skeleton.support[skeleton.segments.index(joint.child)]
    after = [ancestors for ancestors in skeleton.support if (ancestors & child).sum() == child.sum()]
    axes = np.logical_or.reduce(after) & ~child
    return [int(column) for column in np.unique(skeleton.map.owner[axes])]


def _only(loads: JointMoments, known: np.ndarray) -> JointMoments:
    """Return the loads with NaN where they are not known (n, j)."""
    shown = known[:, :, None]
    return replace(loads, moments=np.where(shown, loads.moments, np.nan), forces=np.where(shown, loads.forces, np.nan))


@dataclass(frozen=True, eq=False, repr=False)
class TrialFit:
    """Result of one trial of a `Fit`. Arrays cover the w frames of the measured windows.

    Attributes:
        kinematics: markers, coordinates and ground reactions before estimation.
        skeleton: with this trial's marker positions (`displacement`).
        motion: estimated coordinates (rad, m), and their derivatives as OpenSim's tools compute them from
            `kinematics.mot`, by natural quintic splines through the frames. They differ from the estimate's own
            near the ends of the record only, where `trajectory` is smoothed.
        trajectory: (f, c) coordinates of `kinematics.trajectory_time`: all frames in which any joint's load is known,
            and those between; None after two-level, which has none there.
        motion_hz: bandwidth of the motion.
        reactions: the corresponding ground reactions at the plates' rate, corrected for instrument errors.
        residuals: root residual (w, 6: force N, moment N m about the pelvis origin, ground axes) per stage:
            "literature" (no correction), "corrected" (literature BSPs, pelvis correction), "estimate"; forces have the
            bandwidth of the motion.
        full_residuals: the same at the forces' full bandwidth, with forces as measured before the estimate and
            `reactions` after it. The estimate's equal those of OpenSim's inverse dynamics on the result files.
        joint_loads: joint inverse dynamics (w, c: N m; N for translations) per stage: "literature" (with forces as
            measured), "estimate" (with `reactions`); after two-level both with forces of the motion's bandwidth.
            `moments` returns them as tables.
        deviations: posterior standard deviations of the estimate's curves; None after two-level. `coordinate_sd` and
            `moment_sd` return them as tables.
        marker_errors_m: distances (w, m) between measured and model markers per stage: "ik", "final".
        seconds: computing time per stage.
        joint_curves: joint loads in three dimensions at the frames of `trajectory`, wherever they are known; None after
            two-level.

    Examples:
        >>> trial = fit.trials[0]  # fit = kinertia.fit_subject("subject.toml")
        >>> trial.moments["estimate"]["knee_angle_r"].name, list(trial.residuals)
        ('knee_angle_r', ['literature', 'corrected', 'estimate'])
    """

    kinematics: Kinematics
    skeleton: Skeleton
    motion: Motion
    motion_hz: float
    reactions: GroundReactions
    residuals: Mapping[str, np.ndarray]
    full_residuals: Mapping[str, np.ndarray]
    joint_loads: Mapping[str, np.ndarray]
    deviations: CurveDeviations | None
    marker_errors_m: Mapping[str, np.ndarray]
    seconds: Mapping[str, float]
    trajectory: np.ndarray | None = None
    joint_curves: JointCurves | None = None

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.kinematics.trial.name

    @property
    def time(self) -> np.ndarray:
        """Times (w,) of the frames, s."""
        return self.kinematics.time

    @property
    def coordinates(self) -> pd.DataFrame:
        """Estimated coordinates (rad, m) over time."""
        return by_coordinate(self.kinematics, self.motion.q)

    @property
    def motion_change(self) -> np.ndarray:
        """Estimated coordinates minus those of inverse kinematics (w, c), rad and m; NaN where markers show none."""
        result: np.ndarray = self.motion.q - self.kinematics.ik.q[self.kinematics.frames]
        return result

    @cached_property
    def coordinate_sd(self) -> pd.DataFrame | None:
        """Posterior standard deviations of `coordinates`, in the same form; None after two-level."""
        return None if self.deviations is None else by_coordinate(self.kinematics, self.deviations.coordinates)

    @cached_property
    def strides(self) -> tuple[Stride, ...]:
        """Strides of the whole trial, by plates or else motion; none in squats and landings, found or stated."""
        task = self.kinematics.trial.task
        return () if task in WITHOUT_STRIDES else strides_of(self.skeleton, self.kinematics)

    @cached_property
    def phases(self) -> tuple[Stride, ...]:
        """Phases of contacts with plates that are part of no stride: "stance", or "landing"; none in squats."""
        return contact_phases(self.skeleton, self.kinematics, self.strides)

    @cached_property
    def known_legs(self) -> np.ndarray:
        """Mask (n, 2) of marker frames in which all joint moments of the right, left leg are known."""
        k, skeleton = self.kinematics, self.skeleton
        known = np.repeat((k.inside(k.trial.markers.time) & k.complete)[:, None], 2, axis=1)
        if self.joint_curves is not None:
            for foot, segment in enumerate(skeleton.feet):
                axes = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(segment)]])
                known[:, foot] |= k.known[:, axes[axes >= len(skeleton.joints[0].axes)]].all(axis=1)
        return known

    @cached_property
    def coverage(self) -> tuple[LegCoverage, ...]:
        """Part of stance and stride of the right and the left leg in which all its joint moments are known.

        Empty where nobody walks, turns or runs, or it is unknown when the feet are on the ground.
        """
        trial, sides = self.kinematics.trial, {stride.side for stride in self.strides}
        legs = leg_coverage(trial, self.known_legs) if trial.task in GAIT or sides else ()
        return tuple(leg if leg.side in sides else replace(leg, stride=None) for leg in legs)

    @cached_property
    def moment_gaps(self) -> tuple[MomentGap, ...]:
        """Gaps of the right, then the left leg's moments between the first and the last frame that has any moment."""
        return () if self.joint_curves is None else tuple(_gaps(self.skeleton, self.kinematics, self.known_legs))

    @cached_property
    def moments(self) -> Mapping[str, pd.DataFrame]:
        """Joint moments (`joint_loads`) over time, one column per coordinate."""
        return {stage: by_coordinate(self.kinematics, loads) for stage, loads in self.joint_loads.items()}

    @cached_property
    def moment_sd(self) -> pd.DataFrame | None:
        """Posterior standard deviations of the estimated moments, in the same form; None after two-level."""
        return None if self.deviations is None else by_coordinate(self.kinematics, self.deviations.moments)

    def __repr__(self) -> str:
        """Return name, time and size only, since all the arrays would fill pages."""
        start, end = self.kinematics.window_s
        return f"TrialFit({self.name}: {start:.2f} to {end:.2f} s, {len(self.time)} frames)"

    def _repr_html_(self) -> str:
        """Return the HTML summary for a notebook: frames used, marker distances, residuals."""
        html: str = report_function("trial_fit_html")(self)
        return html


def _gaps(skeleton: Skeleton, k: Kinematics, known: np.ndarray) -> Iterator[MomentGap]:
    """Yield the gaps of each leg, given the frames (n, 2) in which its moments are known."""
    time, loads, frames = k.trial.markers.time, k.trial.loads, k.trajectory_frames
    nearest = nearest_samples(loads.time, time)
    loaded = loads.force[nearest, :, 1] >= LOAD_THRESHOLD_N
    shared = np.zeros(len(time), dtype=bool) if loads.on_shared_plate is None else loads.on_shared_plate[nearest]
    measured = k.trial.known_legs
    for foot, (side, segment) in enumerate(zip(FEET, skeleton.feet, strict=True)):
        moved = np.unique(skeleton.map.owner[skeleton.support[skeleton.segments.index(segment)]])
        reasons = {
            HIDDEN: ~np.isfinite(k.ik.q[:, moved]).all(axis=1),
            OUTSIDE: (time < loads.time[0]) | (time > loads.time[-1]),
            SHARED: ~measured[:, foot] & shared,
            PARTLY: ~measured[:, foot] & loaded[:, foot],
            BESIDE: ~measured[:, foot],
            FAR: ~near_contacts(k.trial),
        }
        which = np.select([known[:, foot], *reasons.values()], [-1, *range(len(reasons))], len(reasons))[frames]
        names = [*reasons, LEFT_OUT]
        for number, name in enumerate(names):
            for first, last in runs(which == number):
                if span_s(time[frames], first, last) >= _SHORTEST_S:
                    yield MomentGap(side, float(time[frames][first]), float(time[frames][last]), name)


def by_coordinate(kinematics: Kinematics, values: np.ndarray) -> pd.DataFrame:
    """Return values (w, c) of all coordinates as a table over the time (s) of the measured windows, one column each."""
    import pandas as pd

    index = pd.Index(kinematics.time, name="time")
    return pd.DataFrame(values, index=index, columns=list(kinematics.ik.coordinates))
