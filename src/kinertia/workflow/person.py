"""Holds what is given of a person, and the model of the person, built in or from a file; solves inverse kinematics."""

import difflib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Literal, Self, TypeVar

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.trajectory_faults import without_copied_frames, without_frames_beside_gaps
from kinertia.diagnostics.model.model_on_person import range_findings
from kinertia.diagnostics.subject.movements import task_of
from kinertia.errors import BlockedError, KinertiaError, MarkerSetError, SettingsError, SubjectError, TrialError
from kinertia.estimation.prepared import Progress, complete_subject, lacking
from kinertia.estimation.prior import BspPrior
from kinertia.estimation.simultaneous.instruments.priors import ModelUncertainty
from kinertia.findings.finding import Finding
from kinertia.io.marker_set_file import marker_set_of, read_marker_set
from kinertia.io.subject.person_recordings import read_static, read_trial
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.coordinate_range import UNKNOWN, Range
from kinertia.model.imported_model import OsimModel, markers_of_model
from kinertia.model.marker_set import MarkerSet, check_marker_set
from kinertia.model.skeleton import Skeleton
from kinertia.motion.kinematics import Kinematics, solve_kinematics
from kinertia.settings import Attached, Overrule, Subject
from kinertia.trial.data import FootLoads, Recording, Trial
from kinertia.trial.sampled_data import within
from kinertia.trial.trial_input import TrialInput

Read = TypeVar("Read")
LOWER_BODY_SD_M = 0.01
UPPER_BODY_SD_M = 0.04
"""How far markers may sit from where the model has them."""


@dataclass(frozen=True, eq=False)
class Person:
    """One person as given, before any question is asked.

    Attributes:
        subject: stated data; mass and height may be None where a recording has them, height and sex with a model.
        trials: recordings of motions, in the order given.
        static: the static trial.
        more_statics: further recordings in which the person stands, of which none is the static trial.
        marker_set: the laboratory's; found among the presets if None.
        model: a scaled OpenSim model, as `kinertia.io.opensim.reader.read_osim` reads it, in place of the static trial.
        calibrate: whether markers and joint centres of that model may move.
        attached: what the person wore or carried in all trials.
        overrule: what the user overrules, for all trials.
        overrule_of: what the user overrules in single trials, by name.
        unread: findings of files that could not be read.
        files_only: whether single files are checked, besides which there may be others.

    Examples:
        >>> person = kinertia.read_person(kinertia.read_subject("lab/subject.toml"))  # the files of `kinertia demo`
        >>> person.static is None, [one.recording.name for one in person.trials]
        (False, ['walk'])
    """

    subject: Subject
    trials: Sequence[TrialInput]
    static: Recording | None = None
    more_statics: Sequence[Recording] = ()
    marker_set: MarkerSet | None = None
    model: OsimModel | None = None
    calibrate: bool = False
    attached: Sequence[Attached] = ()
    overrule: Overrule = field(default_factory=Overrule)
    overrule_of: Mapping[str, Overrule] = field(default_factory=dict)
    unread: Sequence[Finding] = ()
    files_only: bool = False

    @property
    def recordings(self) -> list[Recording]:
        """Recordings of the motions."""
        return [item.recording for item in self.trials]

    def with_overrule(self, overrule: Overrule) -> Self:
        """Return the person with more findings overruled by the user."""
        return replace(self, overrule=self.overrule + overrule)

    @cached_property
    def completed(self) -> Subject | SubjectError:
        """Stated data completed from the files; the error where they are incomplete or cannot be true."""
        try:
            return complete_subject(self.subject, self._files, mass_only=True)
        except SubjectError as error:
            return error

    @property
    def lacking(self) -> list[str]:
        """Data that a fit needs and that neither the user nor a file states: mass, stature, sex."""
        return list(lacking(self.subject, self._files, mass_only=self.model is not None).values())

    @property
    def _files(self) -> list[Recording]:
        """All recordings that may state mass and stature."""
        return [*([] if self.static is None else [self.static]), *self.recordings]

    @cached_property
    def labels(self) -> MarkerSet | MarkerSetError:
        """Marker set that assigns markers to segments, from the model or a preset; the error where none fits."""
        if self.model is not None:
            return markers_of_model(self.model)
        given = [*([] if self.static is None else [self.static]), *self.recordings, *self.more_statics]
        try:
            marker_set = marker_set_of(given[0].markers, self.marker_set)
            if self.marker_set is not None and self.static is not None:
                check_marker_set(marker_set, given[0].markers.labels)
        except MarkerSetError as error:
            return error
        return marker_set


def read_person(wanted: SubjectFile, progress: Progress = lambda stage, share: None) -> Person:
    """Read everything that a subject file names; recordings that cannot be read become findings.

    Raises:
        KinertiaError: the marker set or the model cannot be read, or no trial can.
    """
    marker_set = None if wanted.model.markers is None else read_marker_set(wanted.model.markers)
    model = None if wanted.model.osim is None else _read_model(wanted.model.osim)
    unread = Unread()
    static = None if wanted.model.static is None else unread.tried(lambda: read_static(wanted), None)
    trials = []
    for k, files in enumerate(wanted.trials):
        progress("reading", k / len(wanted.trials))
        trial = unread.tried(partial(read_trial, wanted, files), files.name)
        trials += [] if trial is None else [trial]
    unread.expect_any(trials)
    return Person(
        subject=wanted.subject,
        trials=trials,
        static=static,
        marker_set=marker_set,
        model=model,
        calibrate=wanted.model.calibrate,
        attached=wanted.attached,
        overrule=wanted.diagnostics.overrule,
        overrule_of={files.name: files.diagnostics.overrule for files in wanted.trials},
        unread=tuple(unread.findings),
    )


def _read_model(path: Path) -> OsimModel:
    from kinertia.io.opensim.reader import read_osim  # which few subject files need

    return read_osim(path)


@dataclass
class Unread:
    """Collector of findings about files that cannot be read."""

    findings: list[Finding] = field(default_factory=list)
    errors: list[KinertiaError] = field(default_factory=list)

    def tried(self, read: Callable[[], Read], trial: str | None) -> Read | None:
        """Return what was read; None if reading failed, which is then a finding (of no trial if `trial` is None).

        Raises:
            KinertiaError: an error that is not a finding.
        """
        try:
            return read()
        except KinertiaError as error:
            if error.finding is None:
                raise
            self.errors.append(error)
            self.findings.append(error.finding.in_trial(trial))
            return None

    def expect_any(self, trials: Sequence[object]) -> None:
        """Raise the error of a single unreadable trial as it is, or of several trials all errors at once."""
        if self.errors and not trials:
            raise self.errors[0] if len(self.errors) == 1 else BlockedError(self.findings, self.findings)


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
    """Return the usable trial of a recording: without markers that no frame shows, without frames that are copied or
    mislabelled, and without forces where only its markers are used.

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
    markers = without_frames_beside_gaps(without_copied_frames(trial.markers.select(labels)))
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
        return tuple(kinematics for kinematics in self.kinematics if not kinematics.trial.loads.plates)

    @property
    def with_forces(self) -> Self:
        """The trials whose forces are used.

        Raises:
            SettingsError: none is left.
        """
        expect_forces([kinematics.trial for kinematics in self.kinematics])
        rows = zip(self.kinematics, self.seconds, strict=True)
        kept = [(kinematics, seconds) for kinematics, seconds in rows if kinematics.trial.loads.plates]
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
    for done, rotated in enumerate(trials):
        progress("inverse kinematics", done / len(trials))
        started = time.perf_counter()
        try:
            kinematics.append(solve_kinematics(skeleton, rotated.trial, rotated.angle_deg, smoothing))
        except TrialError as error:
            failed.append(error)
            continue
        ik_s = time.perf_counter() - started
        seconds.append({"read": rotated.read_seconds, "calibration": calibration_s, "ik": ik_s})
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
        >>> from kinertia.workflow.person import trial_without_forces
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
