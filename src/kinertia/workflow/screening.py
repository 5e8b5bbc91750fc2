"""Runs all checks before inverse kinematics, of all recordings of a person, after obvious corrections.

`check` ends here and `fit` goes on from here, so that both run the same checks. A trial with an open ERROR is left
out; one of the person, or of the static trial, stops everything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.landmarks import feet_to_pelvis_m, landmark_positions
from kinertia.diagnostics.markers.unmeasured_data import computed_points
from kinertia.diagnostics.plates.ground_contact import complete_contact
from kinertia.diagnostics.registry import MOTION_CHECKS, PERSON_CHECKS, STATIC_CHECKS
from kinertia.diagnostics.runner import (
    Check,
    added_checks,
    asked,
    blocking,
    explained,
    overruled,
    rules_of,
)
from kinertia.errors import BlockedError, KinertiaError, MarkerSetError, SubjectError
from kinertia.estimation.prepared import TotalMass
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.io.lab_plates import rotation_of_line
from kinertia.model.marker_set import SIDE_NAMES, WIDTHS, MarkerSet, matches_labels, spellings
from kinertia.model.static_landmarks import with_alignment_device
from kinertia.settings import Subject
from kinertia.trial.data import Recording
from kinertia.workflow.person import Person

_OF_FORCES = ("P", "T211", "T212")
"""ERRORs that do not concern the markers."""
_UPRIGHT = 0.9
"""Cosine of 26 degrees between an axis and the line from feet to pelvis."""


@cache
def _motion_checks() -> tuple[Check[Any], ...]:
    """Return the checks of the recording of a motion, with those of other packages, loaded when they are needed."""
    return (*MOTION_CHECKS, *added_checks())


@dataclass(frozen=True, eq=False)
class Screened:
    """A person whose recordings have been screened.

    Attributes:
        person: as given.
        context: what was checked: every recording, also those that are left out.
        findings: all of them, with what explains and what overrules them.
        markers_only: trials that are left out for their forces; their markers can be used beside the others.
    """

    person: Person
    context: PersonContext
    findings: tuple[Finding, ...]
    markers_only: tuple[RecordingContext, ...] = ()

    @property
    def rules(self) -> int:
        """Number of rules that were checked."""
        of_static = STATIC_CHECKS if self.context.standing else ()
        return rules_of(*_motion_checks(), *of_static, *PERSON_CHECKS)

    @cached_property
    def stops(self) -> list[Finding]:
        """Open ERRORs that stop everything: of the person, the model or the static trial."""
        names = {trial.name for trial in self.context.trials} | self._unread
        return [blocker for blocker in blocking(self.findings) if blocker.where.trial not in names]

    @property
    def _unread(self) -> set[str]:
        """Names of the trials that could not be read."""
        return {unread.where.trial for unread in self.person.unread if unread.where.trial is not None}

    @cached_property
    def left_out(self) -> tuple[str, ...]:
        """Names of the trials that have no results."""
        return self.left_out_by(self.findings)

    def left_out_by(self, findings: Sequence[Finding]) -> tuple[str, ...]:
        """Return the names of the trials that cannot be used because of these findings."""
        names = {blocker.where.trial for blocker in blocking(findings)}
        return tuple(
            dict.fromkeys(
                [*sorted(self._unread), *(trial.name for trial in self.context.trials if trial.name in names)]
            )
        )

    def stopped_by(self, findings: Sequence[Finding]) -> set[str | None]:
        """Return the names of the trials that these findings exclude."""
        names = {context.name for context in self.markers_only}
        return {
            blocker.where.trial
            for blocker in blocking(findings)
            if blocker.where.trial not in names or not _of_forces(blocker)
        }

    def overruled(self, findings: Sequence[Finding]) -> list[Finding]:
        """Return findings, those here or more, with what explains and overrules each; what readers refuse stands."""
        refused = {(unread.code, unread.where) for unread in self.person.unread}
        found = overruled(explained(findings), self.person.overrule, self.person.overrule_of)
        return [
            replace(reported, status="open") if (reported.code, reported.where) in refused else reported
            for reported in found
        ]

    @cached_property
    def usable(self) -> list[RecordingContext]:
        """The usable trials, and those of which only the markers are usable.

        Raises:
            BlockedError: none is usable, or something stops everything.
        """
        trials = [trial for trial in self.context.trials if trial.name not in self.left_out]
        if self.stops or not trials:
            raise BlockedError(self.findings, blocking(self.findings))
        return [*trials, *self.markers_only]


def screen(person: Person) -> Screened:
    """Check everything that can be checked before inverse kinematics."""
    person = without_computed_points(with_upright_static(with_model_spelling(person)))
    context = person_context(person)
    found = [*person.unread]
    if isinstance(person.completed, SubjectError) and person.completed.finding is not None:
        found += [person.completed.finding] if person.completed.finding.code == "S102" else []
    for static in context.standing:
        found += _of_recording(static, STATIC_CHECKS)
    for trial in context.trials:
        found += _of_recording(trial, _motion_checks())
    unmatched = person.labels.finding if isinstance(person.labels, MarkerSetError) else None
    if unmatched is not None and unmatched.code not in {reported.code for reported in found}:
        found.append(unmatched)
    found += _of_person(context, found)
    screened = Screened(person, context, ())
    screened = replace(screened, findings=tuple(screened.overruled(found)))
    markers_only = _markers_only(screened)
    if not markers_only:
        return screened
    found += [reported for trial in markers_only for reported in complete_contact(trial)]
    return replace(screened, findings=tuple(screened.overruled(found)), markers_only=markers_only)


def _markers_only(screened: Screened) -> tuple[RecordingContext, ...]:
    """Return the trials excluded for their forces alone, as trials without forces; none if no other trial has any."""
    context, left_out = screened.context, screened.left_out
    if screened.stops or not any(
        not context_of_trial.without_forces
        for context_of_trial in context.trials
        if context_of_trial.name not in left_out
    ):
        return ()
    against = blocking(screened.findings)
    markers_only = tuple(
        replace(context_of_trial, without_forces=True, forces_refused=True)
        for context_of_trial in context.trials
        if context_of_trial.name in left_out
        and all(_of_forces(blocker) for blocker in against if blocker.where.trial == context_of_trial.name)
    )
    if not markers_only:
        return ()
    names = {context_of_trial.name for context_of_trial in markers_only}
    found = [reported for reported in screened.findings if reported.where.trial not in names]
    for trial in markers_only:
        found += _of_recording(trial, _motion_checks())
    trials = [context_of_trial for context_of_trial in context.trials if context_of_trial.name not in names]
    found += _of_person(replace(context, trials=[*trials, *markers_only]), found)
    more = [blocker for blocker in blocking(screened.overruled(found)) if blocker not in against]
    bad = {blocker.where.trial for blocker in more}
    return (
        ()
        if bad - names
        else tuple(context_of_trial for context_of_trial in markers_only if context_of_trial.name not in bad)
    )


def _of_forces(blocker: Finding) -> bool:
    """Return whether a finding is about forces alone."""
    return blocker.code.startswith(_OF_FORCES)


def person_context(person: Person) -> PersonContext:
    """Build the context of the checks of a person."""
    label_set = None if isinstance(person.labels, MarkerSetError) else person.labels
    stated = _stated(person)

    def standing(recording: Recording) -> RecordingContext:
        """Return the context of a recording of standing, with the known joint widths."""
        own_set = label_set
        if own_set is not None and person.model is None:
            recording, own_set = with_widths(recording, person.recordings, own_set, person.subject)
            own_set = with_alignment_device(own_set, recording.markers.labels)
        return RecordingContext(recording, own_set, is_static=True, height_m=stated.height_m, mass_kg=stated.mass_kg)

    static = None if person.static is None else standing(person.static)
    trials = [
        RecordingContext(
            item.recording,
            label_set,
            static,
            False,
            item.window_s,
            stated.height_m,
            stated.mass_kg,
            item.use == "kinematics",
            stated_task=item.task,
            condition=item.condition,
        )
        for item in person.trials
    ]
    total = None if stated.mass_kg is None else _total(stated.mass_kg, person)
    more_statics = [standing(further) for further in person.more_statics]
    return PersonContext(
        stated,
        trials,
        static,
        label_set,
        person.model,
        person.calibrate,
        total,
        more_statics=more_statics,
        files_only=person.files_only,
    )


def _stated(person: Person) -> Subject:
    """Return stated data completed from the files; as stated where incomplete, without what cannot be true."""
    if isinstance(person.completed, SubjectError):
        return person.subject.model_copy(update={person.completed.field: None})
    return person.completed


def _total(mass_kg: float, person: Person) -> TotalMass | None:
    try:
        return TotalMass.of(mass_kg, person.attached)
    except KinertiaError:
        return None


def _of_recording(context: RecordingContext, checks: Sequence[Check[RecordingContext]]) -> list[Finding]:
    read = [
        reported if reported.where.trial is not None else reported.in_trial(context.name)
        for reported in context.recording.findings
    ]
    return [*read, *asked(checks, context, read, context.name)]


def _of_person(context: PersonContext, found: Sequence[Finding]) -> list[Finding]:
    """Check the person with the trials that are not blocked: another person's forces would contradict the mass."""
    blocked = {blocker.where.trial for blocker in blocking(explained(found))}
    sound = replace(
        context, trials=[trial for trial in context.trials if trial.name not in blocked], found=tuple(found)
    )
    of_person = [reported for reported in found if reported.where.trial is None]
    return [_in_model(reported, context) for reported in asked(PERSON_CHECKS, sound, of_person)]


def _in_model(reported: Finding, context: PersonContext) -> Finding:
    """Add the model's file name to a finding about the OpenSim model itself."""
    if context.model is None or reported.where.trial is not None or not reported.code.startswith("O"):
        return reported
    return reported.in_file(context.model.path.name)


def with_upright_static(person: Person) -> Person:
    """Return the person with the static trial rotated to Y up (F133) where another axis leads from feet to pelvis.

    One with loads on plates is left as it is, since those would have to be rotated by their own axes.
    """
    static = person.static
    if static is None or static.plates is not None or isinstance(person.labels, MarkerSetError):
        return person
    line = feet_to_pelvis_m(landmark_positions(static.markers, person.labels))
    if line is None or np.abs(line).max() < _UPRIGHT * np.linalg.norm(line):
        return person
    rotation, axis = rotation_of_line(line)
    if axis == "+Y":
        return person
    note = finding("F133", Where(trial=static.name), axis=Quantity(axis), source=Quantity("the feet and the pelvis"))
    upright = replace(
        static, markers=static.markers.rotated(rotation), vertical=axis, findings=(*static.findings, note)
    )
    return replace(person, static=upright)


def with_model_spelling(person: Person) -> Person:
    """Return the person, with trials labelled as the static trial or the model where only then the marker set fits them
    (L103).
    """
    marker_set, static = person.labels, person.static
    if isinstance(marker_set, MarkerSetError) or (static is None and person.model is None):
        return person
    known = marker_set.labels if static is None or person.model is not None else static.markers.labels
    trials = [replace(trial, recording=_spelled(trial.recording, marker_set, known)) for trial in person.trials]
    return person if trials == [*person.trials] else replace(person, trials=trials)  # which would look for a set again


def _spelled(recording: Recording, marker_set: MarkerSet, known: Sequence[str]) -> Recording:
    labels = recording.markers.labels
    if matches_labels(marker_set, labels):
        return recording
    read_as = {written: label for label, written in spellings(known, labels).items()}
    alike = tuple(read_as.get(label, label) for label in labels)
    if not matches_labels(marker_set, alike):
        return recording
    found = [
        finding("L103", Where(markers=(written,)), written=Quantity(written), label=Quantity(label))
        for written, label in read_as.items()
        if label in marker_set.labels
    ]
    markers = replace(recording.markers, labels=alike)
    return replace(recording, markers=markers, findings=(*recording.findings, *found))


def with_widths(
    static: Recording, trials: Sequence[Recording], marker_set: MarkerSet, subject: Subject
) -> tuple[Recording, MarkerSet]:
    """Return the static trial with all known widths and S105 for each from another file, and the set that includes
    them.

    The subject file takes precedence over the static trial, and that over the other trials.
    """
    names, widths_m, borrowed = dict(marker_set.widths), dict(static.measurements), []
    for joint in WIDTHS:
        key = f"{joint.rpartition('_')[0]}_width_mm"
        given = getattr(subject, key)
        if given is not None:
            names[joint], widths_m[key] = key, given / 1e3
            continue
        name = names.get(joint)
        if name is None or widths_m.get(name, 0.0) > 0.0:
            continue
        other = next((trial for trial in trials if trial.measurements.get(name, 0.0) > 0.0), None)
        if other is not None:
            widths_m[name] = other.measurements[name]
            where = Where(file=other.name, part=f"{SIDE_NAMES[joint[-1]]} {joint.rpartition('_')[0]}")
            borrowed.append(finding("S105", where, width_m=Quantity(widths_m[name], "m")))
    found = (*static.findings, *borrowed)
    return replace(static, measurements=widths_m, findings=found), replace(marker_set, widths=names)


def without_computed_points(person: Person) -> Person:
    """Return the person, with an OpenSim model, without markers that were calculated from others (M151).

    They contain no measurement of their own, and the model's joint centres do not depend on them. Without a model they
    may be what the laboratory places joints by: they stay.
    """
    if person.model is None or isinstance(person.labels, MarkerSetError):
        return person
    trials = [replace(trial, recording=_measured_only(trial.recording, person.labels)) for trial in person.trials]
    return person if trials == [*person.trials] else replace(person, trials=trials)


def _measured_only(recording: Recording, marker_set: MarkerSet) -> Recording:
    found = list(computed_points(recording, marker_set, Severity.CORRECTED))
    computed = {label for reported in found for label in reported.where.markers}
    if not computed:
        return recording
    measured = [label for label in recording.markers.labels if label not in computed]
    return replace(recording, markers=recording.markers.select(measured), findings=(*recording.findings, *found))
