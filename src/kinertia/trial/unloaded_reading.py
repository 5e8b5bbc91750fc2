"""Determines the reading of an unloaded force plate from the times at which its mean force hardly changes."""

import numpy as np
import numpy.typing as npt

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import BoolArray, FloatArray
from kinertia.trial.force_resolution import ringing_s
from kinertia.trial.sampled_time import runs, span_s
from kinertia.trial.unloaded_level import UnloadedReading

_BLOCK_S, _FEWEST_BLOCKS = 0.1, 4
"""Block length in whole periods of the mains, of 50 and of 60 Hz, so that interference averages to zero."""
_IDLE_N, _STEADY_N, _IDLE_SHARE, _LEAST_PEAK_N = 150.0, 7.5, 0.2, 100.0
"""While no one steps on or off for a tenth of a second, a plate reads less than the first on average, and half a block
earlier or later the same within the second. If its peak is a load, it reads less than a fifth of the peak: half the
weight of a child is 100 N."""
_CONSTANT_N, _CONSTANT_NM, _MOST_BLOCKS = 7.5, 5.0, 0.8
"""A constant level is within these of its median in most of the blocks."""
_RANGE_PERCENT, _RISING, _MOST_RISING, _SHORTEST_STEP_S = (1.0, 99.0), (0.2, 0.5), 0.2, 0.1
"""A force under feet is between 20 and 50 % of its peak for less than a tenth of the time, noise for two fifths."""
_SWAYS, _ROUGH, _FEWEST = 0.03, 0.1, 20
"""Shares of the peak for feet that stay on the plate: least standard deviation of the load, and its largest change from
sample to sample; noise about a zero offset of some newtons with the same standard deviation jumps by more."""


def unloaded_reading(time: FloatArray, force: FloatArray, moment: FloatArray) -> UnloadedReading:
    """Determine the reading of a plate while it is unloaded.

    Args:
        time: (k,) s.
        force, moment: (k, 3) N and N m about the ground origin, as read.
    """
    vertical = force[:, 1]
    peak_n = float(np.abs(vertical).max(initial=0.0))
    blocks = unloaded_blocks(time, vertical)
    if len(blocks) < _FEWEST_BLOCKS:
        return UnloadedReading((np.nan,) * 3, np.nan, peak_n, ringing_s(time, vertical), _like_steps(time, vertical))
    levels = np.median(force[blocks], axis=1)
    x, y, z = (float(value) for value in np.median(levels, axis=0))
    when = time[blocks].mean(axis=1)
    drift_n = float(np.polyfit(when - when.mean(), levels[:, 1], 1)[0]) * float(time[-1] - time[0])
    level_nm, twist_nm = _moment(force, moment, blocks, np.array([x, y, z]))
    return UnloadedReading(
        (x, y, z),
        drift_n,
        peak_n,
        ringing_s(time, vertical - y),
        _like_steps(time, vertical),
        level_nm,
        twist_nm,
        noise_n=float(np.std(vertical[blocks] - y)),
        constant=bool((_deviation(levels) < _CONSTANT_N).all()),
    )


def _moment(
    force: FloatArray, moment: FloatArray, blocks: npt.NDArray[np.int_], level_n: FloatArray
) -> tuple[tuple[float, float, float], float]:
    """Return the median moment (N m) about the ground origin in these blocks, and its largest part about the mean CoP.

    If the file has no moment there, it is the moment of a level (3,) N acting at the mean centre of pressure.
    """
    moments = np.median(moment[blocks], axis=1)
    steady = bool((_deviation(moments) < _CONSTANT_NM).all())
    level_nm = np.median(moments, axis=0) if steady else np.zeros(3)
    there = np.cross(_mean_point(force - level_n, moment - level_nm), level_n)
    about = level_nm - there
    if not level_nm[[0, 2]].any():
        # either the file has no centre of pressure for the unloaded plate, and at most a torque, or the level is
        # horizontal: the smaller torque is the likelier
        about = min(about, level_nm, key=np.linalg.norm)
    x, y, z = (float(value) for value in about + there)
    return (x, y, z), float(about[np.argmax(np.abs(about))])


def unloaded_blocks(time: FloatArray, vertical: FloatArray) -> npt.NDArray[np.int_]:
    """Return the samples (b, s) of the blocks in which a plate with this vertical force (k,) is unloaded."""
    peak_n = float(np.abs(vertical).max(initial=0.0))
    every = max(2, round(_BLOCK_S / float(np.median(np.diff(time))))) if len(time) > 1 else 2
    count = len(time) // every
    blocks = np.arange(count * every).reshape(count, every)
    if not count:
        return blocks
    total = np.concatenate([[0.0], np.cumsum(vertical)])
    mean = (total[every:] - total[:-every]) / every  # mean of the block that begins at each sample
    first = blocks[:, 0]
    near = [mean[np.clip(first + off, 0, len(mean) - 1)] for off in (0, -(every // 2), every // 2)]
    most = min(_IDLE_N, _IDLE_SHARE * peak_n) if peak_n > _LEAST_PEAK_N else _IDLE_N
    steady = np.ptp(near, axis=0) < _STEADY_N
    unloaded: npt.NDArray[np.int_] = blocks[steady & (np.abs(near[0]) < most)]
    return unloaded


def _deviation(levels: FloatArray) -> FloatArray:
    """Return the distances (3,) from their median within which most of the levels (b, 3) lie."""
    return np.quantile(np.abs(levels - np.median(levels, axis=0)), _MOST_BLOCKS, axis=0)


def _mean_point(force: FloatArray, moment: FloatArray) -> FloatArray:
    """Return the mean centre of pressure (3,) m of the loads (k, 3); the origin if there are none."""
    loaded: BoolArray = force[:, 1] > FIRM_LOAD_N
    if not loaded.any():
        return np.zeros(3)
    upward = float(force[loaded, 1].sum())
    return np.array([moment[loaded, 2].sum() / upward, 0.0, -moment[loaded, 0].sum() / upward])


def _like_steps(time: FloatArray, vertical: FloatArray) -> bool:
    """Decide whether a force (k,) of any unit looks like the load of feet.

    It does if it acts in one direction, is mostly either near zero or near its full size, and stays so for a while; or
    if it is always present and sways smoothly. Noise, drift and mains interference have both signs or never return to
    zero, are in between as often as not, leave the upper half at once, or are rough.
    """
    if len(time) < _FEWEST:
        return False
    low, high = np.percentile(vertical if vertical.max() > -vertical.min() else -vertical, _RANGE_PERCENT)
    share = np.abs(vertical) / max(float(high), 1e-12)
    if low > _RISING[1] * high:
        after = time - time.mean()
        sways = share - np.polyval(np.polyfit(after, share, 1), after)
        return bool(np.std(sways) > _SWAYS) and float(np.abs(np.diff(share)).max()) < _ROUGH
    between = float(((share > _RISING[0]) & (share < _RISING[1])).mean())
    lasts = [span_s(time, first, last) for first, last in runs(share > _RISING[1])]
    returns = bool(abs(low) < _RISING[0] * high)
    return returns and between < _MOST_RISING and max(lasts, default=0.0) >= _SHORTEST_STEP_S
