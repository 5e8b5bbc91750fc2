"""Corrects recordings before any check: labels spelled otherwise, a static trial that is not upright, points that a
program calculated among the markers of a model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.evidence.landmarks import feet_to_pelvis_m, landmark_positions
from kinertia.diagnostics.markers.computed_markers import computed_points
from kinertia.errors import MarkerSetError
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.io.lab_axes import rotation_of_line
from kinertia.model.marker_set import MarkerSet, matches_labels, spellings
from kinertia.trial.data import Recording
from kinertia.workflow.person import Person

_UPRIGHT = 0.9
"""Cosine of 26 degrees between an axis and the line from feet to pelvis."""


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
    trials = [replace(one, recording=_spelled(one.recording, marker_set, known)) for one in person.trials]
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


def without_computed_points(person: Person) -> Person:
    """Return the person, with an OpenSim model, without markers that were calculated from others (M151).

    They contain no measurement of their own, and the model's joint centres do not depend on them. Without a model they
    may be what the laboratory places joints by: they stay.
    """
    if person.model is None or isinstance(person.labels, MarkerSetError):
        return person
    trials = [replace(one, recording=_measured_only(one.recording, person.labels)) for one in person.trials]
    return person if trials == [*person.trials] else replace(person, trials=trials)


def _measured_only(recording: Recording, marker_set: MarkerSet) -> Recording:
    found = list(computed_points(recording, marker_set, Severity.CORRECTED))
    computed = {label for one in found for label in one.where.markers}
    if not computed:
        return recording
    measured = [label for label in recording.markers.labels if label not in computed]
    return replace(recording, markers=recording.markers.select(measured), findings=(*recording.findings, *found))
