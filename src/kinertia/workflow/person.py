"""Holds what is given of one person: recordings, marker set or model, statements, and what is overruled."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Self, TypeVar

from kinertia.errors import BlockedError, KinertiaError, MarkerSetError, SubjectError
from kinertia.estimation.prepare.prepared import complete_subject, lacking
from kinertia.findings.finding import Finding
from kinertia.io.marker_set_file import marker_set_of, read_marker_set
from kinertia.io.subject.person_recordings import read_static, read_trial
from kinertia.io.subject.tables import SubjectFile
from kinertia.model.imported_model import OsimModel, markers_of_model
from kinertia.model.marker_set import MarkerSet, check_marker_set
from kinertia.settings import Attached, Overrule, Subject
from kinertia.trial.data import Recording
from kinertia.trial.trial_input import TrialInput

Progress = Callable[[str, float], None]
Read = TypeVar("Read")


@dataclass(frozen=True, eq=False)
class Person:
    """One person as given, before any question is asked.

    Attributes:
        subject: stated data.
        trials: recordings of motions, in the order given.
        static: the static trial.
        more_statics: further recordings in which the person stands, of which none is the static trial.
        marker_set: the laboratory's; found among the presets if None.
        model: the OpenSim model, in place of the static trial.
        calibrate: whether markers and joint centres of the model may move.
        attached: what the person wore or carried.
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
