"""Asks whether the plates bear another person for a while, with the participant or elsewhere."""

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.force_mass import FOREIGN_SHARE
from kinertia.diagnostics.evidence.stray_loads import STRAY_M
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity


def foreign_load(context: RecordingContext) -> Iterator[Finding]:
    """Report P284: a foreign load; an ERROR if it leaves hardly any frames."""
    found = context.foreign_load
    if found is None:
        return
    names = () if context.plates is None else context.plates.names
    plates = {names[one.plate] for one in context.foreign_contacts}
    left = context.trial_on_plates is not None and bool(plates)
    where = context.at(plate=plates.pop() if plates else None, span_s=found.span_s)
    surplus = Quantity(found.surplus, "1", limit=FOREIGN_SHARE)
    yield finding("P284", where, None if left else Severity.ERROR, surplus=surplus)


def stray_loads(context: RecordingContext) -> Iterator[Finding]:
    """Report P285: loads that are under no foot and were left out."""
    names = () if context.plates is None else context.plates.names
    for one in context.stray_contacts:
        where = context.at(plate=names[one.plate], span_s=(float(one.time[0]), float(one.time[-1])))
        yield finding("P285", where, distance_m=Quantity(one.distance_m, "m", limit=STRAY_M, usual=(0.0, 0.04)))
