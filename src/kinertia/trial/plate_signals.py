"""Cleans the signals of a force plate: subtracts its unloaded reading, and bridges spikes.

A foot loads a plate more slowly: a force that jumps and returns within 2 ms, and hardly changes before and after, does
not come from a foot. On 71 plates, recorded at 900 to 2000 Hz, forces differed from their median over 8 ms by at most
119 N vertically (ringing as a heel landed on one plate; 50 N on the others) and 24 N horizontally. One sample of 2 kN
at 1000 Hz, left in the forces, changed joint moments by up to ten standard deviations.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from kinertia.trial.sampled_data import runs

FloatArray = npt.NDArray[np.float64]
LIMITS_N = (100.0, 200.0, 100.0)
"""Smallest spikes, along X, Y and Z. Smaller ones have no effect on joint moments."""
_WINDOW_S, LONGEST_S = 0.004, 0.002
_STEP_BESIDE, _STEPS = 0.15, 2
"""Share of a spike by which the force may change in each of the samples before and after it. In the hardest landings,
too, it rises and falls over several samples."""
ZEROED_N, ZEROED_NM = 3.0, 1.0
"""Zeroed plates read less than this while unloaded."""
_NOWHERE = (np.nan, np.nan, np.nan)


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
    return bridged[0], bridged[1], tuple(spike for *_, spike in spikes)


def _distance_from_median(force: FloatArray, around: int) -> FloatArray:
    """Return the distances (k, 3) of forces from their running median, zero where no jump is near."""
    jump = (np.abs(np.diff(force, axis=0)) > np.array(LIMITS_N) / around).any(axis=1)
    near = np.convolve(np.concatenate([[False], jump]), np.ones(2 * around + 1), "same") > 0.0
    distance, at = np.zeros_like(force), np.flatnonzero(near)
    window = np.clip(at[:, None] + np.arange(-around, around + 1), 0, len(force) - 1)
    distance[at] = force[at] - np.median(force[window], axis=1)
    return distance


class UnloadedReading(NamedTuple):
    """Reading of a force plate while it is unloaded.

    Attributes:
        level_n: median force along X, Y, Z, N; NaN if it is hardly ever unloaded.
        drift_n: linear change of the vertical force over the recording, N; NaN likewise.
        peak_n: the largest vertical force of the whole recording, N.
        overshoot_s: for how long the vertical force is below zero just before foot contact and just after foot off, s;
            0 unless it does both.
        like_steps: the vertical force rises and falls as under feet, at any scale.
        level_nm: median moment about the ground origin, N m; if the file has none for the unloaded plate, the moment of
            `level_n` acting at the mean centre of pressure.
        twist_nm: largest component of the moment about the mean centre of pressure, N m.
        noise_n: standard deviation of the vertical force, N; NaN if the plate is hardly ever unloaded.
        constant: the level is the same whenever the plate is unloaded.
        subtracted: the level has been subtracted from the loads.
    """

    level_n: tuple[float, float, float]
    drift_n: float
    peak_n: float
    overshoot_s: float
    like_steps: bool = False
    level_nm: tuple[float, float, float] = _NOWHERE
    twist_nm: float = 0.0
    noise_n: float = np.nan
    constant: bool = False
    subtracted: bool = False

    @property
    def off_zero(self) -> bool:
        """Whether the level is constant and larger than that of a zeroed plate."""
        return self.constant and (max(map(abs, self.level_n)) > ZEROED_N or abs(self.twist_nm) > ZEROED_NM)

    @property
    def remaining_n(self) -> tuple[float, float, float]:
        """Part of `level_n` that is still in the loads, N."""
        return (0.0, 0.0, 0.0) if self.subtracted else self.level_n

    def added(self, times: float, force: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return force (k, 3) and moment (k, 3) with `times` times the level added."""
        return force + times * np.array(self.level_n), moment + times * np.array(self.level_nm)
