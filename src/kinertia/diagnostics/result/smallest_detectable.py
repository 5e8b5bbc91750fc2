"""Computes how large an error of all plates, or of one, must be for trials to show it."""

import numpy as np

from kinertia.estimation.simultaneous.instruments.plates import FLOOR_UNKNOWNS, PLATE_UNKNOWNS
from kinertia.estimation.simultaneous.instruments.priors import InstrumentInformation, InstrumentPrior


def smallest_detectable(shown: InstrumentInformation, prior: InstrumentPrior, unknown: str) -> float:
    """Return the smallest error of all plates that the trials make likelier than fault-free ones; infinite if none is.

    Args:
        shown: information of the trials on plates and synchronisation, without any prior.
        prior: their prior, including information from other people of the session.
        unknown: one of FLOOR_UNKNOWNS.
    """
    return _smallest(shown, prior, len(shown.rhs) - 1 - len(FLOOR_UNKNOWNS) + list(FLOOR_UNKNOWNS).index(unknown))


def smallest_detectable_of_one(shown: InstrumentInformation, prior: InstrumentPrior, unknown: str) -> float:
    """Return the same of an error of a single plate (one of PLATE_UNKNOWNS), whichever shows it least."""
    first, each = list(PLATE_UNKNOWNS).index(unknown), len(PLATE_UNKNOWNS)
    return max((_smallest(shown, prior, first + each * k) for k in range(len(shown.plates))), default=0.0)


def _smallest(shown: InstrumentInformation, prior: InstrumentPrior, place: int) -> float:
    unknowns = prior.of_unknowns(shown.plates).own
    precision = np.array([0.0 if k == place else 1.0 / one.sd**2 for k, one in enumerate(unknowns)])
    information = shown.information + prior.of_session(shown.plates).information + np.diag(precision)
    if not information[place, place] > 0.0:
        return np.inf
    deviation = float(np.sqrt(np.linalg.inv(information)[place, place]))
    return unknowns[place].smallest_detectable(deviation)
