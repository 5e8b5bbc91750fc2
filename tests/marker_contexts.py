"""Contexts of recordings whose markers are changed, and what a question finds in them."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from kinertia.diagnostics.context import RecordingContext
from kinertia.findings.finding import Finding
from kinertia.model.marker_set import MarkerSet
from kinertia.trial.data import Markers, Recording


def context_of(markers: Markers | Recording, marker_set: MarkerSet | None = None, **options: Any) -> RecordingContext:
    """Of a recording, or of markers alone."""
    recording = markers if isinstance(markers, Recording) else Recording("walk", markers, None)
    return RecordingContext(recording, marker_set, **options)


def codes(findings: Iterable[Finding]) -> list[str]:
    """Of findings, in their order."""
    return [finding.code for finding in findings]


def relabelled(markers: Markers, *pairs: tuple[str, str]) -> Markers:
    """The markers with each two labels swapped."""
    other = {a: b for pair in pairs for a, b in (pair, pair[::-1])}
    return replace(markers, labels=tuple(other.get(label, label) for label in markers.labels))


def changed(markers: Markers, change: Callable[[Any, Any], None]) -> Markers:
    """The markers with positions (n, m, 3) that a function of them and of the time changes in place."""
    positions = markers.positions.copy()
    change(positions, markers.time)
    return replace(markers, positions=positions)
