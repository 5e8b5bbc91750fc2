"""Selects one cutoff for motion and forces of a trial before any estimate.

Generalised cross-validation treats everything that is not white noise as motion. Markers that were smoothed before
export contain no white noise any more, and skin motion is not white: in half of the trials of other laboratories it
chooses no smoothing at all. The bandwidth of the body's motion follows from the ground reactions, whose sum is its mass
times the acceleration of its centre of mass: the search ends where they contain little above it, at 6 Hz in squats and
slow walks, 8 or 10 Hz in brisk walks, 15 Hz in runs and jumps.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.motion.smoothing import smooth
from kinertia.trial.data import Trial
from kinertia.trial.sampled_data import span_s, within

LOWEST_HZ = 3.0
ENDS_HZ = (6.0, 8.0, 10.0, 12.0, 15.0)
LEFT_SHARE_OF_WEIGHT = 0.02
"""Largest RMS residual of the ground reactions above the cutoff, as a share of their mean vertical force. For walks it
yields the usual cutoffs."""
_ENOUGH_HZ = 100.0
_FEWEST = 20


@dataclass(frozen=True)
class Cutoff:
    """Cutoff of motion and forces.

    Attributes:
        hz: frequency at which the gain is 1/2.
        sentence: how it was chosen; empty if the user set it.
    """

    hz: float
    sentence: str = ""


def common_cutoff(time: np.ndarray, pelvis: np.ndarray, trial: Trial) -> Cutoff:
    """Choose the cutoff by cross-validation of pelvis translations (n, 3) m at times (n,) s, up to what forces need.

    Raises:
        SmoothingError: a translation is known in too few frames.
    """
    end = _motion_ends_hz(trial)
    hz = float(np.median(smooth(time, pelvis, "gcv", (LOWEST_HZ, end)).cutoff_hz))
    reason = "chosen by cross-validation"
    if hz > 0.999 * end:
        reason = (
            "the upper limit of the automatic search: the ground reactions contain little above it"
            if end < ENDS_HZ[-1]
            else "the upper limit of the automatic search"
        )
    return Cutoff(
        hz,
        f"before the estimate, motion and forces are smoothed at {hz:.1f} Hz, {reason}; to choose another cutoff: "
        f"cutoff_hz under [settings]",
    )


def _loaded_s(trial: Trial) -> tuple[float, float]:
    """Return the first and last time (s) of any load."""
    time = trial.loads.time[(trial.loads.force[:, :, 1] > 0.0).any(axis=1)]
    return float(time[0]), float(time[-1])


def _motion_ends_hz(trial: Trial) -> float:
    """Return the lowest of ENDS_HZ that leaves little of the ground reactions in the longest measured window."""
    loads, (start, end) = trial.loads, (trial.windows() or [_loaded_s(trial)])[0]
    inside = within(loads.time, start, end)
    time, force = loads.time[inside], loads.force[inside].sum(axis=1)
    if len(time) < _FEWEST:
        return ENDS_HZ[-1]
    # means over a hundredth of a second retain what is faster than a cutoff at 15 Hz
    per_sample = max(1, int((len(time) - 1) / span_s(time) / _ENOUGH_HZ))
    count = len(time) // per_sample
    time, force = (part[: count * per_sample].reshape(count, per_sample, -1).mean(axis=1) for part in (time, force))
    limit = LEFT_SHARE_OF_WEIGHT * force[:, 1].mean()
    for hz in ENDS_HZ:
        left = force - smooth(time[:, 0], force, hz)(time[:, 0])
        if np.sqrt(np.square(left).sum(axis=1).mean()) <= limit:
            return hz
    return ENDS_HZ[-1]
