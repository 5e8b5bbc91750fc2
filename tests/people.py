"""Persons as questions see them, from recordings, models and what is stated."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.estimation.prepared import TotalMass
from kinertia.findings.finding import Finding
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.imported_model import OsimModel
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Skeleton
from kinertia.settings import Attached, Subject
from kinertia.trial.data import Markers, Recording


def person(
    trials: Sequence[Recording] = (),
    static: Recording | None = None,
    marker_set: MarkerSet | None = None,
    more_statics: Sequence[Recording] = (),
    attached: Sequence[Attached] = (),
    **subject,
) -> PersonContext:
    """A person with these recordings; what is stated of the subject are further arguments."""
    stated = Subject(name="person", **subject)
    total = None if stated.mass_kg is None else TotalMass.of(stated.mass_kg, attached)
    still = None if static is None else RecordingContext(static, marker_set, is_static=True)
    moving = [RecordingContext(trial, marker_set, still) for trial in trials]
    others = [RecordingContext(more_static, marker_set, is_static=True) for more_static in more_statics]
    return PersonContext(stated, moving, still, marker_set, None, False, total, (), others)


def with_markers(recording: Recording, markers: Markers, name: str | None = None) -> Recording:
    """A recording with other markers, and perhaps another name."""
    return replace(recording, markers=markers, name=name or recording.name)


def only_markers(name: str, markers: Markers) -> Recording:
    """A recording without forces."""
    return Recording(name, markers)


def with_model(skeleton: Skeleton, bsp: BodySegmentParameters, **subject) -> PersonContext:
    """A model that is looked at alone."""
    file = OsimModel(Path("model.osim"), b"", skeleton, bsp, (), (), {})
    return replace(person(**subject), model=file)


UNMOVED = RecordingContext(Recording("walk", Markers(np.array([0.0, 0.1]), ("S",), np.zeros((2, 1, 3)))))
"""A trial of nothing."""


def scaled(markers: Markers, factor: float) -> Markers:
    """About the middle, so that the person stays on the plates."""
    middle = np.nanmean(markers.positions, axis=(0, 1))
    return replace(markers, positions=factor * (markers.positions - middle) + middle)


def codes(findings: Sequence[Finding]) -> list[str]:
    """Of findings."""
    return [finding.code for finding in findings]
