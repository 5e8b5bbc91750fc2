"""S50, were all people of a session measured with the same instruments?"""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.estimation.simultaneous.calibration_entry import CalibrationEntry
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where

APART_SD = Limit(3.0)


def session_contradictions(
    person: str, own: Sequence[CalibrationEntry], others: Sequence[CalibrationEntry]
) -> Iterator[Finding]:
    """Report S501: instrument errors that differ between one person's trials and the others' in a session.

    Args:
        person: name of the person.
        own, others: errors of instruments by their trials.
    """
    by_others = {one.key: one for one in others}
    for one in own:
        other = by_others.get(one.key, one)
        apart_sd = float(np.hypot(one.sd, other.sd))
        if abs(one.value - other.value) > APART_SD * apart_sd:
            yield finding(
                "S501",
                Where(plate=one.plate, part=f"{one} by {person}"),
                error=Quantity(one.value, one.unit, sd=one.sd),
                other_error=Quantity(other.value, one.unit, sd=other.sd),
                sd=Quantity(apart_sd, one.unit, limit=APART_SD * apart_sd),
                person=Quantity(person),
                instrument=Quantity(str(one)),
            )
