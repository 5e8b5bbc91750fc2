"""Asks whether the plates bear somebody else for a while."""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.force_mass import FOREIGN_SHARE
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity


def foreign_load(context: RecordingContext) -> Iterator[Finding]:
    """P284, an ERROR where hardly any frames are left without that load."""
    found = context.foreign_load
    if found is None:
        return
    names = () if context.plates is None else context.plates.names
    plates = {names[one.plate] for one in context.foreign_contacts}
    left = context.trial_on_plates is not None and bool(plates)
    where = context.at(plate=plates.pop() if plates else None, span_s=found.span_s)
    surplus = Quantity(found.surplus, "1", limit=FOREIGN_SHARE)
    yield finding("P284", where, None if left else Severity.ERROR, surplus=surplus)
