"""Finds and bridges spikes in the signals of a force plate: electrical disturbances of a few samples.

A foot loads a plate more slowly: a force that jumps and returns within 2 ms, and hardly changes before and after, does
not come from a foot. On 71 plates, recorded at 900 to 2000 Hz, forces differed from their median over 8 ms by at most
119 N vertically (ringing as a heel landed on one plate; 50 N on the others) and 24 N horizontally. One sample of 2 kN
at 1000 Hz, left in the forces, changed joint moments by up to ten standard deviations.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from kinertia.trial.sampled_time import runs

FloatArray = npt.NDArray[np.float64]

LIMITS_N = (100.0, 200.0, 100.0)
"""Smallest spikes, along X, Y and Z. Smaller ones have no effect on joint moments."""
_WINDOW_S, LONGEST_S = 0.004, 0.002
_STEP_BESIDE, _STEPS = 0.15, 2
"""Share of a spike by which the force may change in each of the samples before and after it. In the hardest landings,
too, it rises and falls over several samples."""


class ForceSpike(NamedTuple):
    """A spike that was bridged.

    Attributes:
        time_s: time of its largest sample.
        axis: 0, 1 or 2, the axis along which it is largest.
        size_n: its distance from the forces around it, N.
    """

    time_s: float
    axis: int
    size_n: float


def without_spikes(
    time: FloatArray, force: FloatArray, moment: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[ForceSpike, ...]]:
    """Replace spikes of a plate by straight lines.

    Args:
        time: (k,) s. Samples farther apart than 2 ms show no spikes.
        force, moment: (k, 3) N and N m.

    Returns:
        Force, moment, and the spikes.

    >>> time, force = np.arange(100) / 1000, np.full((100, 3), [0.0, 700.0, 0.0])
    >>> force[50, 1] = 2700.0
    >>> mended, _, spikes = without_spikes(time, force, np.zeros((100, 3)))
    >>> float(mended[50, 1]), spikes
    (700.0, (ForceSpike(time_s=0.05, axis=1, size_n=2000.0),))
    """
    around = int(_WINDOW_S / float(np.median(np.diff(time))) + 1e-6) if len(time) > 1 else 0
    if around < 2 or not np.isfinite(force).all():
        return force, moment, ()
    beyond = np.abs(_distance_from_median(force, around)) / LIMITS_N
    spikes = []
    for first, last in runs(np.asarray((beyond > 1.0).any(axis=1))):
        axis = int(np.argmax(beyond[first : last + 1].max(axis=0)))
        here = force[max(first - 1 - _STEPS, 0) : last + 2 + _STEPS, axis]
        if last - first + 1 > max(1, around * LONGEST_S / _WINDOW_S) or len(here) < last - first + 3 + 2 * _STEPS:
            continue
        inside = here[_STEPS : len(here) - _STEPS]
        size = inside - np.linspace(inside[0], inside[-1], len(inside))
        steps = np.abs(np.diff([here[: _STEPS + 1], here[-_STEPS - 1 :]]))
        at = int(np.argmax(np.abs(size)))
        if abs(size[at]) > max(LIMITS_N[axis], steps.max() / _STEP_BESIDE):
            spikes.append((first, last, ForceSpike(float(time[first - 1 + at]), axis, float(size[at]))))
    if not spikes:
        return force, moment, ()
    unaffected = np.ones(len(time), dtype=bool)
    for first, last, _ in spikes:
        unaffected[first : last + 1] = False
    bridged = [
        np.column_stack([np.interp(time, time[unaffected], column[unaffected]) for column in signal.T])
        for signal in (force, moment)
    ]
    return bridged[0], bridged[1], tuple(one for *_, one in spikes)


def _distance_from_median(force: FloatArray, around: int) -> FloatArray:
    """Return the distances (k, 3) of forces from their running median, zero where no jump is near."""
    jump = (np.abs(np.diff(force, axis=0)) > np.array(LIMITS_N) / around).any(axis=1)
    near = np.convolve(np.concatenate([[False], jump]), np.ones(2 * around + 1), "same") > 0.0
    distance, at = np.zeros_like(force), np.flatnonzero(near)
    window = np.clip(at[:, None] + np.arange(-around, around + 1), 0, len(force) - 1)
    distance[at] = force[at] - np.median(force[window], axis=1)
    return distance
