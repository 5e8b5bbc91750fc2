"""P23, do the forces point the right way? Reports a rotation of plates about the vertical, or that none can be seen.

A rotation shows in the direction in which the ground accelerates the body. Where noisy markers contain little
information on that, the prior takes the plates as fault-free, and a rotation of a few degrees goes unnoticed into the
joint moments.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, equal
from kinertia.diagnostics.result.smallest_detectable import unnoticed
from kinertia.estimation.simultaneous.calibration_entry import ROTATION
from kinertia.findings.finding import Finding, finding

_MATTERS_RAD = float(np.radians(2.0))
"""In the least informative walk of the reference recordings, 3 degrees change joint moments by twice their SDs."""


def plate_rotation(context: ResultContext) -> Iterator[Finding]:
    """Report rotations that were corrected, of all plates or of one, and one too small for these trials to show."""
    rotations = [one for one in context.errors if one.quantity == ROTATION]
    usual_sd = context.ready.uncertainty.instruments.plate["turn"].sd
    if equal(rotations, usual_sd) or len(rotations) == 1:
        largest = max(rotations, key=lambda one: abs(one.value))
        yield from corrected(context, "P234", "rotation_rad", [replace(largest, plate=None)])
    else:
        yield from corrected(context, "P237", "rotation_rad", rotations)
    if least := unnoticed(context, "turn", _MATTERS_RAD, "rad"):
        yield finding("P235", detectable_rad=least)
