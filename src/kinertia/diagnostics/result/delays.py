"""T21, do forces and markers run at the same time? Delays that the estimate has corrected."""

from __future__ import annotations

from collections.abc import Iterator

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected
from kinertia.estimation.simultaneous.calibration_entry import DELAY
from kinertia.findings.finding import Finding


def delays(context: ResultContext) -> Iterator[Finding]:
    """The delay of all forces, and how much more those of single trials are late."""
    for one in context.errors:
        if one.quantity == DELAY:
            yield from corrected(context, "T214" if one.trial is None else "T215", "delay_s", [one])
