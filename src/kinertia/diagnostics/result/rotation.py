"""P23, do the forces point the right way? Reports a rotation of plates about the vertical, or that none can be seen.

A rotation shows in the direction in which the ground accelerates the body. Where noisy markers contain little
information on that, the prior takes the plates as fault-free, and a rotation of a few degrees goes unnoticed into the
joint moments.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected, equal
from kinertia.diagnostics.result.smallest_detectable import smallest_detectable, smallest_detectable_of_one
from kinertia.estimation.simultaneous.calibration_entry import ROTATION
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_MATTERS_RAD = float(np.radians(2.0))
"""In the least informative walk of the reference recordings, 3 degrees change joint moments by twice their SDs."""
_OF_ONE_MATTERS_RAD = float(np.radians(4.0))
"""In reference walks, 5 degrees of one plate change joint moments by one to two SDs."""
_LARGEST_RAD = float(np.radians(10.0))
"""Three prior SDs of a rotated plate. A larger estimate points to another fault, which no rotation corrects."""


def plate_rotation(context: ResultContext) -> Iterator[Finding]:
    """Report rotations that were corrected, of all plates or of one, and one too small for these trials to show."""
    rotations = [one for one in context.errors if one.quantity == ROTATION]
    usual_sd = context.ready.uncertainty.instruments.plate["turn"].sd
    if equal(rotations, usual_sd) or len(rotations) == 1:
        largest = max(rotations, key=lambda one: abs(one.value))
        yield from corrected(context, "P234", "rotation_rad", [replace(largest, plate=None)], _LARGEST_RAD)
    else:
        yield from corrected(context, "P237", "rotation_rad", rotations, _LARGEST_RAD)
    if context.fit.posterior is None:
        return
    known = context.fit.posterior.instruments, context.ready.uncertainty.instruments
    all_rad, one_rad = smallest_detectable(*known, "turn"), smallest_detectable_of_one(*known, "turn")
    if _MATTERS_RAD < all_rad < np.inf or _OF_ONE_MATTERS_RAD < one_rad < np.inf:
        of_all, of_one = (
            Quantity(all_rad, "rad", limit=_MATTERS_RAD),
            Quantity(one_rad, "rad", limit=_OF_ONE_MATTERS_RAD),
        )
        yield finding("P235", detectable_rad=of_all, of_one_rad=of_one)
