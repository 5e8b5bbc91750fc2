"""Computes the horizontal zero offsets that a tilt between force plates and cameras imitates.

Plates are levelled, and the cameras' frame is laid on the floor, each to about 0.1 degrees. A tilt of 0.14 degrees
turns 0.24 % of the vertical force into a horizontal one: 1.5 N under a person of 60 kg. In one trial this cannot be
distinguished from a zero offset; in the next, in which the plates bear other loads, it looks like another zero offset.
It is part of the uncertainty of zero offsets from one trial.
"""

import numpy as np

from kinertia.estimation.simultaneous.observed_trial import Observation

TILT_SD_RAD = float(np.radians(0.14))
"""Standard deviation of the tilt about each horizontal axis: two instruments, each level to 0.1 degrees."""


def mean_loads_n(trial: Observation) -> np.ndarray:
    """Return the mean vertical force (p,) on each of the trial's plates, while it is loaded."""
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
