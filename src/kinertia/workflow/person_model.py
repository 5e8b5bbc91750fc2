"""Defines the model of a person, built in or from a file, and runs inverse kinematics of all trials with it."""

import difflib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import without_copied_frames
from kinertia.diagnostics.model.model_on_person import range_findings
from kinertia.diagnostics.subject.movements import task_of
from kinertia.errors import SettingsError, TrialError
from kinertia.estimation.prepare.prepared import Progress
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.priors import ModelUncertainty
from kinertia.findings.finding import Finding
from kinertia.model.coordinate_range import UNKNOWN, Range
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.settings import Subject
from kinertia.trial.data import FootLoads, Recording, Trial
from kinertia.trial.sampled_data import within

LOWER_BODY_SD_M = 0.01
UPPER_BODY_SD_M = 0.04
"""How far markers may sit from where the model has them."""


@dataclass(frozen=True)
class RotatedTrial:
    """A trial in the axes in which it is solved.

    Attributes:
        trial: facing +X with the built-in model, as recorded with an OpenSim model.
        angle_deg: angle by which it was rotated about the vertical.
        read_seconds: time taken to read it.
    """

    trial: Trial
    angle_deg: float = 0.0
    read_seconds: float = 0.0


def usable_trial(context: RecordingContext) -> Trial:
    """Return the usable trial of a recording: without markers that no frame shows, without copied frames, and without
    forces where only its markers are used.

    Frames in which a foot bears load beyond its plate are not measured, unless the user vouches for a window, or
    hardly any others are left.
    """
    if context.without_forces:
        trial: Trial | None = trial_without_forces(context.recording, context.window_s)
    else:
        trial = context.trial
    assert trial is not None
    seen = trial.markers.seen
    labels = [label for column, label in enumerate(trial.markers.labels) if seen[:, column].any()]
    usable = context.trial_on_plates or trial
    markers = without_copied_frames(trial.markers.select(labels))
    return replace(usable, markers=markers, task=task_of(context), condition=context.condition)


@dataclass(frozen=True, eq=False)
class Solved:
    """Kinematics of the trials that could be solved, with seconds by stage; findings about them, and why the others
    could not be solved.
    """

    kinematics: tuple[Kinematics, ...]
    seconds: tuple[Mapping[str, float], ...]
    findings: tuple[Finding, ...]

    @property
    def without_forces(self) -> tuple[Kinematics, ...]:
        """Kinematics of the trials whose markers alone are used."""
        return tuple(one for one in self.kinematics if not one.trial.loads.plates)

    @property
    def with_forces(self) -> Self:
        """The trials whose forces are used.

        Raises:
            SettingsError: none is left.
        """
        expect_forces([one.trial for one in self.kinematics])
        rows = zip(self.kinematics, self.seconds, strict=True)
        kept = [(one, seconds) for one, seconds in rows if one.trial.loads.plates]
        return replace(self, kinematics=tuple(k for k, _ in kept), seconds=tuple(seconds for _, seconds in kept))


def expect_forces(trials: Sequence[Trial]) -> None:
    """Raise a SettingsError unless one of these trials has forces."""
    if not any(trial.loads.plates for trial in trials):
        raise SettingsError.of_entry("[[trial]]", 'expected a usable trial with forces, without use = "kinematics"')


def solved_trials(
    skeleton: Skeleton,
    trials: Sequence[RotatedTrial],
    smoothing: float | Literal["gcv"],
    calibration_s: float,
    progress: Progress,
) -> Solved:
    """Solve and smooth the coordinates of all trials.

    Args:
        skeleton: the calibrated skeleton.
        trials: trials in the axes in which they are solved.
        smoothing: cutoff in Hz, or "gcv".
        calibration_s: seconds per trial that calibration took.
        progress: called as the work progresses.

    Raises:
        TrialError: no trial can be solved.
    """
    kinematics, seconds, failed = [], [], []
    for done, one in enumerate(trials):
        progress("inverse kinematics", done / len(trials))
        started = time.perf_counter()
        try:
            kinematics.append(solve_kinematics(skeleton, one.trial, one.angle_deg, smoothing))
        except TrialError as error:
            failed.append(error)
            continue
        ik_s = time.perf_counter() - started
        seconds.append({"read": one.read_seconds, "calibration": calibration_s, "ik": ik_s})
    reasons = [error.finding for error in failed if error.finding is not None]
    if failed and (not kinematics or len(reasons) < len(failed)):
        raise failed[0]
    found: list[Finding] = []
    for k in kinematics:
        found += [*k.findings, *(limit.in_trial(k.trial.name) for limit in range_findings(skeleton, k.ik))]
    return Solved(tuple(kinematics), tuple(seconds), (*found, *reasons))


def trial_without_forces(recording: Recording, window_s: tuple[float, float] | None = None) -> Trial:
    """Return the trial without plates; every frame counts, or only frames of the window (s) that the user states.

    Examples:
        >>> from kinertia.workflow.person_model import trial_without_forces
        >>> recording = kinertia.read_recording("lab/walk.trc", "lab/walk_grf.mot")
        >>> trial_without_forces(recording).loads.plates
        ()
    """
    time = recording.markers.time
    zero = np.zeros((len(time), 2, 3))
    used = np.ones(len(time), dtype=bool) if window_s is None else within(time, *window_s)
    return Trial(
        recording.name,
        recording.markers,
        FootLoads(time, zero, zero, plates=()),
        used,
        recording.notes,
        recording.virtual_sd_m,
        recording.belt,
        vertical=recording.vertical,
        events=recording.events,
    )


@dataclass(frozen=True, eq=False)
class PersonModel:
    """A model adapted to a person and the trials, before these are solved.

    Attributes:
        subject: with what the files add.
        note: which model it is.
        trials: usable trials, in the axes in which they are solved.
        skeleton: adapted to them.
        prior: of the body segment parameters.
        uncertainty: what else the estimate may move.
        findings: what adapting it showed.
        assumed: findings about assumptions made for the model.
        elbow_rotations_rad, torso_rotation_rad: as in `Prepared`.
    """

    subject: Subject
    note: str
    trials: Sequence[RotatedTrial]
    skeleton: Skeleton
    prior: BspPrior
    uncertainty: ModelUncertainty
    findings: Sequence[Finding] = ()
    assumed: Sequence[Finding] = ()
    elbow_rotations_rad: Mapping[str, float] = field(default_factory=dict)
    torso_rotation_rad: float | None = None


def with_stated_ranges(skeleton: Skeleton, subject: Subject) -> Skeleton:
    """Replace ranges of motion of the skeleton by those in the subject file; clamped coordinates stay clamped.

    Raises:
        SettingsError: the model has no such coordinate.
    """
    ranges = dict(skeleton.ranges)
    for name, degrees in (subject.ranges_deg or {}).items():
        if name not in skeleton.coordinates:
            near = difflib.get_close_matches(name, skeleton.coordinates, n=1) or skeleton.coordinates[6:7]
            raise SettingsError.of_entry(
                "ranges_deg under [subject]", f"no coordinate {name} moves; there is {near[0]}"
            )
        low, high = np.radians(degrees).tolist()
        ranges[name] = Range(low, high, ranges.get(name, UNKNOWN).clamped, stated=True)
    return replace(skeleton, ranges=ranges)
