"""P23, do the forces point the right way? A rotation of all plates about the vertical, found or not to be seen.

A rotation shows in the direction in which the ground pushes the body. Where noisy markers say little of that, the prior
decides that plates are fault-free, and a rotation of a few degrees goes unnoticed into the joint moments.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.diagnostics.result.corrections import corrected
from kinertia.estimation.simultaneous.calibration_entry import ROTATION
from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity

_MATTERS_RAD = float(np.radians(2.0))
"""In the least informative walk of the reference recordings, 3 degrees change joint moments by twice their SDs."""


def plate_rotation(context: ResultContext) -> Iterator[Finding]:
    """Report a rotation of all plates that was corrected, and one too small for these trials to show."""
    yield from corrected(context, "P234", "rotation_rad", [one for one in context.errors if one.quantity == ROTATION])
    if context.fit.posterior is None:
        return
    least = smallest_detectable_rad(context.fit.posterior.instruments, context.ready.uncertainty.instruments)
    if _MATTERS_RAD < least < np.inf:
        yield finding("P235", detectable_rad=Quantity(least, "rad", limit=_MATTERS_RAD))


def smallest_detectable_rad(shown: InstrumentInformation, prior: InstrumentPrior) -> float:
    """Return the smallest rotation (rad) at which the trials make rotated plates likelier than fault-free ones.

    Args:
        shown: information of the trials on plates and synchronisation, without any prior.
        prior: what was known of them before, from other people of the session, too.
    """
    place = len(shown.rhs) - 1 - len(FLOOR_UNKNOWNS) + list(FLOOR_UNKNOWNS).index("turn")
    unknowns = prior.of_unknowns(shown.plates).own
    precision = np.array([0.0 if k == place else 1.0 / one.sd**2 for k, one in enumerate(unknowns)])
    information = shown.information + prior.of_session(shown.plates).information + np.diag(precision)
    deviation = float(np.sqrt(np.linalg.inv(information)[place, place]))
    return unknowns[place].smallest_detectable(deviation)
