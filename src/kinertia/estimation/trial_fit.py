"""Defines the result of an estimate for one trial: `TrialFit`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kinertia.estimation.joint_curves import JointCurves
from kinertia.estimation.simultaneous.uncertainty.curve_deviations import CurveDeviations
from kinertia.model.skeleton import Skeleton
from kinertia.motion.dynamics import Motion
from kinertia.motion.gait_cycle import Stride, contact_phases, strides_of
from kinertia.motion.ground_reactions import GroundReactions
from kinertia.motion.kinematics import Kinematics
from kinertia.trial import display
from kinertia.trial.trial_input import WITHOUT_STRIDES

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class TrialFit:
    """Result of one trial of a `Fit`. Arrays cover the w frames of the measured windows.

    Attributes:
        kinematics: markers, coordinates and ground reactions before estimation.
        skeleton: with this trial's marker positions (`displacement`).
        motion: estimated coordinates (rad, m), and their derivatives as OpenSim's tools compute them from
            `kinematics.mot`, by natural quintic splines through the frames. They differ from the estimate's own in the
            first and last frames only.
        course: (f, c) coordinates of `kinematics.course_time`: all frames in which any joint's load is known, and
            those between; None after two-level, which has none there.
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
        joint_curves: joint loads in three dimensions at the frames of `course`, wherever they are known; None after
            two-level and in older files.

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
    course: np.ndarray | None = None
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
        return display.html(self)


def by_coordinate(kinematics: Kinematics, values: np.ndarray) -> pd.DataFrame:
    """Return values (w, c) of all coordinates as a table over the time (s) of the measured windows, one column each."""
    import pandas as pd

    index = pd.Index(kinematics.time, name="time")
    return pd.DataFrame(values, index=index, columns=list(kinematics.ik.coordinates))
