"""P21, are the plates' zeros right? What the estimate found of the zeros of horizontal forces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, equal
from kinertia.estimation.simultaneous.calibration_entry import ZERO
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity


def zero_offsets(context: ResultContext) -> Iterator[Finding]:
    """Zeros that were corrected, and those that all plates of a trial have alike: rather a force that none measures."""
    zeros = [one for one in context.errors if one.quantity == ZERO]
    yield from corrected(context, "P215", "zero_n", zeros)
    for trial, axis in dict.fromkeys((one.trial, one.axis) for one in zeros):
        own = [one for one in zeros if (one.trial, one.axis) == (trial, axis)]
        if equal(own):
            read_n = tuple(one.value for one in own)
            yield finding(
                "P214",
                context.along(axis, trial),
                force_n=Quantity(float(np.mean(read_n)), "N", sd=max(one.sd for one in own)),
                zero_n=Quantity(read_n, "N", limit=2.0 * own[0].prior_sd),
            )
