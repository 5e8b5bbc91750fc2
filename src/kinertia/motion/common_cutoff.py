"""Chooses one cutoff for motion and forces of a trial before any estimate.

Generalised cross-validation takes everything for motion that is not white noise. Markers that were smoothed before they
were exported have no white noise left, and skin motion is none: in half of the trials of other laboratories it chooses
no smoothing at all. How fast the body moves is written in the ground reactions, whose sum is its mass times the
acceleration of its centre of mass: the search ends where they have hardly anything more, at 6 Hz in squats and a slow
walk, 8 or 10 in a brisk one, 15 in runs and jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinertia.motion.smoothing import smooth
from kinertia.trial.data import Trial
from kinertia.trial.sampled_time import span_s, within

LOWEST_HZ = 3.0
ENDS_HZ = (6.0, 8.0, 10.0, 12.0, 15.0)
LEFT_SHARE_OF_WEIGHT = 0.02
"""RMS force that a cutoff may leave of the ground reactions, share of their mean vertical force. Of walks it makes the
cutoffs that are usual."""
_ENOUGH_HZ = 100.0
_FEWEST = 20


@dataclass(frozen=True)
class Cutoff:
    """Of motion and forces.

    Attributes:
        hz: where the gain is 1/2.
        sentence: how it was chosen; empty where the user did.
    """

    hz: float
    sentence: str = ""


def common_cutoff(time: np.ndarray, pelvis: np.ndarray, trial: Trial) -> Cutoff:
    """By cross-validation of the pelvis' translations (n, 3) m at these times (n,) s, up to what the forces need.

    Raises:
        SmoothingError: a translation is known in too few frames.
    """
    end = _motion_ends_hz(trial)
    hz = float(np.median(smooth(time, pelvis, "gcv", (LOWEST_HZ, end)).cutoff_hz))
    reason = "chosen by cross-validation"
    if hz > 0.999 * end:
        reason = (
            "where the search of cross-validation ends, since the ground reactions have hardly anything faster"
            if end < ENDS_HZ[-1]
            else "where the search of cross-validation ends"
        )
    return Cutoff(
        hz,
        f"before the estimate, motion and forces are smoothed at {hz:.1f} Hz, {reason}; to choose another cutoff: "
        f"cutoff_hz under [settings]",
    )


def _motion_ends_hz(trial: Trial) -> float:
    """The lowest of ENDS_HZ that leaves little of the ground reactions in the longest measured window."""
    loads, (start, end) = trial.loads, trial.windows()[0]
    inside = within(loads.time, start, end)
    time, force = loads.time[inside], loads.force[inside].sum(axis=1)
    if len(time) < _FEWEST:
        return ENDS_HZ[-1]
    # what is faster than a cutoff at 15 Hz shows in means over a hundredth of a second just as well
    together = max(1, int((len(time) - 1) / span_s(time) / _ENOUGH_HZ))
    count = len(time) // together
    time, force = (part[: count * together].reshape(count, together, -1).mean(axis=1) for part in (time, force))
    limit = LEFT_SHARE_OF_WEIGHT * force[:, 1].mean()
    for hz in ENDS_HZ:
        left = force - smooth(time[:, 0], force, hz)(time[:, 0])
        if np.sqrt(np.square(left).sum(axis=1).mean()) <= limit:
            return hz
    return ENDS_HZ[-1]
