"""How far the vertical of the force plates is from the cameras': what a tilt makes of the zeros of horizontal forces.

Plates are levelled and cameras are calibrated with a frame on the floor, each to about as much as plates are turned
about the vertical. A tilt by a tenth of a degree puts 0.17 % of the vertical force into the horizontal ones: a newton
under somebody who stands still. Of one trial this looks like zeros that are off; of the next, in which plates are
loaded otherwise, like other zeros. It belongs to the error of what one trial says of zeros.
"""

from __future__ import annotations

import numpy as np

from kinertia.estimation.simultaneous.observed_trial import Observation

TILT_SD_RAD = float(np.radians(0.1))
"""Each way; as sound plates are turned about the vertical (`instruments.FLOOR_PRIOR`)."""


def mean_loads_n(trial: Observation) -> np.ndarray:
    """(p,) vertical force of a person on each of the trial's plates, while somebody stands on it."""
    if not trial.ground.plates:
        return np.zeros(0)
    frames = np.flatnonzero(trial.dynamic)
    vertical = trial.ground.loads(trial.time[frames]).reshape(-1, 2, 6)[..., 1]
    stood = trial.ground.loaded(trial.time[frames]).reshape(-1, 2)
    result = np.zeros(len(trial.ground.plates))
    for plate in range(len(result)):
        share = np.where(trial.ground.carrier[frames] == plate, np.clip(stood, 0.0, 1.0), 0.0)
        result[plate] = (share * vertical).sum() / max(share.sum(), 1.0)
    return result
