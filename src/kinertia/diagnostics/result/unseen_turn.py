"""From which angle on the trials of a person show that all plates are turned about the vertical.

A turn shows in the direction in which the ground pushes the body. Where noisy markers say little of that, the prior
decides that plates are sound, and a turn of a few degrees goes unnoticed into the joint moments.
"""

from __future__ import annotations

import numpy as np

from kinertia.estimation.simultaneous.instruments import InstrumentInformation, InstrumentPrior
from kinertia.estimation.simultaneous.plates import FLOOR_UNKNOWNS

_MATTERS_RAD = float(np.radians(2.0))
"""In the walk of those at hand that tells least, 3 degrees change joint moments by twice their deviations."""


def unseen_turn_note(shown: InstrumentInformation, prior: InstrumentPrior) -> str:
    """What a user should know of turns that the trials do not show; empty where they show those that matter.

    Args:
        shown: what the trials say of plates and clock, without any prior.
        prior: what was known of them before, from other people of the session, too.
    """
    least = least_turn_rad(shown, prior)
    if not _MATTERS_RAD < least < np.inf:
        return ""
    return (
        f"these trials show a turn of all plates about the vertical from {np.degrees(least):.1f} degrees on; a smaller "
        "one would go unnoticed, and a few degrees matter: survey the plates' corners with markers, or fit with trials "
        "that show more ([instruments] session)"
    )


def least_turn_rad(shown: InstrumentInformation, prior: InstrumentPrior) -> float:
    """The smallest turn by which the trials make turned plates likelier than sound ones."""
    place = len(shown.right) - 1 - len(FLOOR_UNKNOWNS) + list(FLOOR_UNKNOWNS).index("turn")
    unknowns = prior.of_unknowns(shown.plates).own
    precision = np.array([0.0 if k == place else 1.0 / one.sd**2 for k, one in enumerate(unknowns)])
    information = shown.information + prior.of_session(shown.plates).information + np.diag(precision)
    deviation = float(np.sqrt(np.linalg.inv(information)[place, place]))
    return unknowns[place].least_told(deviation)
