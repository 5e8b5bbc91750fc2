"""P24, are the loads under the feet? Reports a displacement of all plates that the trials cannot show.

An equal displacement of all plates along the walking direction has the same effect as shifted centres of mass. Without
a walk in the opposite direction, the prior mostly keeps the plates where the files have them: in eight walks made by
OpenSim with both plates 20 mm too far forward, knee and ankle moments are wrong by 7 N m, and 46 to 54 % of them lie in
their 95 % intervals. With a second walk in the opposite direction, 18 of 20 mm are found.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.smallest_detectable import smallest_detectable
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_MATTERS_M = 0.015
"""Of three walks that show 19 mm sideways, two do not show plates displaced by 20 mm: their moments err by 5 N m."""


def common_offset(context: ResultContext) -> Iterator[Finding]:
    """Report axes along which a displacement of all plates that matters would go unnoticed."""
    if context.fit.posterior is None:
        return
    known = context.fit.posterior.instruments, context.ready.uncertainty.instruments
    for axis in "xz":
        least_m = smallest_detectable(*known, axis)
        if _MATTERS_M < least_m < np.inf:
            yield finding("P248", context.along(axis, None), detectable_m=Quantity(least_m, "m", limit=_MATTERS_M))
