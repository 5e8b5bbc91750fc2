"""Which samples of a force plate are a load, how a load begins and ends, and how noisy the unloaded plate is.

Below some 20 N the centre of pressure is a quotient of two noises, and all day long a plate reads a little of
something. But a foot that lands or leaves passes through these small forces too: set to zero, they are missing from the
legs' joint moments. So what joins a load without a break and stands out of the plate's noise belongs to it, and acts
where the nearest firm sample does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, IdleReading
from kinertia.trial.force_resolution import ringing_s
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, nearest_samples, runs, span_s

LONGEST_TAIL_S = 0.03
"""A foot lands or leaves within less; what lasts longer below the threshold is an offset."""
_ABOVE_NOISE, _LEAST_TAIL_N = 4.0, 1.0
_FEWEST_IDLE = 20
_IDLE_MOST_N, _STEADY_N = 3 * LOAD_THRESHOLD_N, 5.0
"""An idle level is below the first, and varies by less than the second: a foot that lands or leaves does not."""
_BLOCK_S, _FEWEST_BLOCKS = 0.1, 4
_IDLE_BLOCK_N, _STEADY_BLOCK_N, _IDLE_SHARE, _LEAST_PEAK_N = 150.0, 15.0, 0.2, 100.0
"""In a tenth of a second in which nobody steps on or off, a plate reads less than the first, and varies by less than
the second. Of what it carries at its peak, if that is a load, it reads less than a fifth: half a child is 100 N."""
_RANGE_PERCENT, _RISING, _MOST_RISING, _SHORTEST_STEP_S = (1.0, 99.0), (0.2, 0.5), 0.2, 0.1
"""Between 20 and 50 % of its peak a force under feet is for less than a tenth of the time, noise for two fifths."""
_SWAYS, _ROUGH = 0.03, 0.1
"""Of the peak: deviation of the load of feet that stay, at least, and its largest change from sample to sample, at
most; noise that makes a zero of some newtons deviate as much jumps by more."""
_GAUSSIAN = 1.4826
"""Deviation of Gaussian noise over its median absolute deviation."""


class PlateLoad(NamedTuple):
    """One plate without what it reads when unloaded: force (k, 3) N, moment (k, 3) N m, noise of the vertical force
    N, and what it read."""

    force: FloatArray
    moment: FloatArray
    noise_n: float
    idle: IdleReading


def without_idle(time: FloatArray, force: FloatArray, moment: FloatArray) -> PlateLoad:
    """Zero wherever nobody stands on the plate.

    Args:
        time: (k,) s.
        force, moment: (k, 3) N and N m about the ground origin, on the person; where the force is below
            LOAD_THRESHOLD_N the moment is not looked at and may be anything.
    """
    loaded = force[:, 1] >= load_threshold_n(force[:, 1])
    offset_n, noise_n = _idle(force[~loaded, 1])
    idle = idle_reading(time, force)
    if not loaded.any():
        return PlateLoad(np.zeros_like(force), np.zeros_like(force), noise_n, idle)
    firm = np.flatnonzero(loaded)
    nearest = firm[nearest_samples(time[firm], time)] if len(firm) > 1 else np.full(len(time), firm[0])
    stands_out = force[:, 1] > max(offset_n + _ABOVE_NOISE * noise_n, _LEAST_TAIL_N)
    near = np.abs(time - time[nearest]) <= LONGEST_TAIL_S + TIME_TOLERANCE_S
    tail = _joining(loaded, loaded | (stands_out & near)) & ~loaded
    point = centre_of_pressure(np.concatenate([force, moment], axis=1)[nearest])
    moment = np.where(loaded[:, None], moment, np.where(tail[:, None], np.cross(point, force), 0.0))
    return PlateLoad(np.where((loaded | tail)[:, None], force, 0.0), moment, noise_n, idle)


def idle_reading(time: FloatArray, force: FloatArray) -> IdleReading:
    """What a plate reads (k, 3) N while nobody stands on it: in tenths of a second in which little changes."""
    peak_n = float(np.abs(force[:, 1]).max(initial=0.0))
    course = ringing_s(time, force[:, 1]), _like_steps(time, force[:, 1])
    every = max(2, round(_BLOCK_S / float(np.median(np.diff(time))))) if len(time) > 1 else 2
    count = len(time) // every
    if not count:
        return IdleReading((np.nan,) * 3, np.nan, peak_n, *course)
    blocks = force[: count * every].reshape(count, every, 3)
    low, high = np.percentile(blocks[..., 1], (5, 95), axis=1)
    level = np.median(blocks, axis=1)
    most = min(_IDLE_BLOCK_N, _IDLE_SHARE * peak_n) if peak_n > _LEAST_PEAK_N else _IDLE_BLOCK_N
    idle = (high - low < _STEADY_BLOCK_N) & (np.abs(level[:, 1]) < most)
    if idle.sum() < _FEWEST_BLOCKS:
        return IdleReading((np.nan,) * 3, np.nan, peak_n, *course)
    x, y, z = (float(value) for value in np.median(level[idle], axis=0))
    when = time[: count * every].reshape(count, every).mean(axis=1)[idle]
    drift_n = float(np.polyfit(when - when.mean(), level[idle, 1], 1)[0]) * float(time[-1] - time[0])
    return IdleReading((x, y, z), drift_n, peak_n, *course)


def _like_steps(time: FloatArray, vertical: FloatArray) -> bool:
    """Whether a force (k,) of whatever unit is like the load of feet: it pushes one way, is either next to nothing or
    nearly all there, and stays so for a while; or it is always there and sways smoothly.

    Noise, drift and hum go both ways or never back to zero, are in between as often as not, leave the upper half at
    once, or are rough.
    """
    if len(time) < _FEWEST_IDLE:
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


def load_threshold_n(vertical: FloatArray) -> float:
    """From which vertical force (k,) on a plate is loaded: above what it reads when nobody stands on it.

    A plate that was not zeroed reads 20 to 40 N all day long: small forces that hardly change are its idle level.
    """
    offset_n, noise_n = _idle(vertical[vertical < _IDLE_MOST_N])
    if noise_n > _STEADY_N:
        return LOAD_THRESHOLD_N
    return max(LOAD_THRESHOLD_N, offset_n + max(_ABOVE_NOISE * noise_n, LOAD_THRESHOLD_N / 2))


def _joining(loaded: BoolArray, candidates: BoolArray) -> BoolArray:
    """The candidates, among which are the loaded samples, that no other sample parts from a loaded one."""
    stretch = np.cumsum(np.diff(candidates, prepend=False))
    joins: BoolArray = candidates & np.isin(stretch, stretch[loaded])
    return joins


def _idle(vertical: FloatArray) -> tuple[float, float]:
    """Offset and deviation (N) of what an unloaded plate reads; zero where it is hardly ever unloaded."""
    if len(vertical) < _FEWEST_IDLE:
        return 0.0, 0.0
    offset = float(np.median(vertical))
    return offset, float(_GAUSSIAN * np.median(np.abs(vertical - offset)))
