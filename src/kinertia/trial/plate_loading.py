"""Separates load from idle samples of a force plate, and measures the idle noise.

Below some 20 N the centre of pressure is a quotient of two noises, and all day long a plate reads a little of
something. But a foot that lands or leaves passes through these small forces too: set to zero, they are missing from the
legs' joint moments. So what joins a load without a break and stands out of the plate's noise belongs to it, and acts
where the nearest firm sample does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.idle_level import IdleReading
from kinertia.trial.idle_reading import idle_blocks, idle_reading
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, nearest_samples, runs

LONGEST_TAIL_S = 0.03
"""A foot lands or leaves within less; what lasts longer below the threshold is an offset."""
_ABOVE_NOISE, _LEAST_TAIL_N = 4.0, 1.0
_FEWEST_IDLE = 20
_IDLE_MOST_N, _STEADY_N = 3 * LOAD_THRESHOLD_N, 5.0
"""An idle level is below the first, and varies by less than the second: a foot that lands or leaves does not."""
_NOISY_N, _MAINS_S = 5.0, 0.02
"""Beyond the former, loads are looked for in the mean over the latter, a period of the mains."""
_IDLE_PERCENT, _BEYOND_IDLE, _STEP_BEYOND, _WANDERS_N = 99.0, 1.5, 2.0, 30.0
"""A load is beyond nearly all of what the idle plate reads by the one factor, and somewhere by the other too; a mean
farther from the usual level is no reading of an idle plate."""
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
    """Take off what the plate reads while nobody stands on it, and set everything to zero there.

    Args:
        time: (k,) s.
        force, moment: (k, 3) N and N m about the ground origin, on the person; where the force is below
            LOAD_THRESHOLD_N the moment is not looked at and may be anything.
    """
    idle = idle_reading(time, force, moment)
    if idle.off_zero:
        force, moment = idle.added(-1.0, force, moment)
        idle = idle._replace(subtracted=True)
    loaded = _loaded(time, force[:, 1], idle)
    offset_n, noise_n = _idle(force[~loaded, 1])
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


def largest_n(time: FloatArray, force: FloatArray) -> float:
    """The vertical force that is farthest from what the idle plate reads, of forces (k, 3), without that reading."""
    level_n = float(np.nan_to_num(idle_reading(time, force, np.zeros_like(force)).level_n[1]))
    return float(force[np.argmax(np.abs(force[:, 1] - level_n)), 1]) - level_n


def with_idle_levels(plates: PlateLoads) -> PlateLoads:
    """The loads as they were read, with what the idle plates read: of a laboratory that vouches for its zeros."""
    force, moment, readings = plates.force.copy(), plates.moment.copy(), list(plates.idle or ())
    for p, idle in enumerate(readings):
        if idle.subtracted:
            loaded = force[:, p, 1] != 0.0
            force[loaded, p], moment[loaded, p] = idle.added(1.0, force[loaded, p], moment[loaded, p])
            readings[p] = idle._replace(subtracted=False)
    return replace(plates, force=force, moment=moment, idle=tuple(readings) or plates.idle)


def _loaded(time: FloatArray, vertical: FloatArray, idle: IdleReading) -> BoolArray:
    """(k,) where a vertical force (k,) is beyond what the idle plate reads."""
    if np.isnan(idle.noise_n):
        loaded: BoolArray = vertical >= load_threshold_n(vertical)
        return loaded
    course = vertical - idle.left_n[1]
    if idle.noise_n > _NOISY_N:
        period = min(max(1, round(_MAINS_S / float(np.median(np.diff(time))))), len(course))
        mean = np.convolve(course, np.full(period, 1.0 / period), mode="valid")
        course = mean[np.clip(np.arange(len(course)) - period // 2, 0, len(mean) - 1)]
    blocks = course[idle_blocks(time, vertical)]
    usual = np.abs(blocks[np.abs(blocks.mean(axis=1)) < _WANDERS_N])
    beyond_n = _BEYOND_IDLE * float(np.percentile(usual, _IDLE_PERCENT)) if usual.size else 0.0
    threshold_n = max(LOAD_THRESHOLD_N - idle.left_n[1], LOAD_THRESHOLD_N / 2, beyond_n)
    loaded = course >= threshold_n
    if beyond_n >= threshold_n:
        for first, last in runs(loaded):
            loaded[first : last + 1] &= course[first : last + 1].max() >= _STEP_BEYOND * threshold_n
    return loaded


def load_threshold_n(vertical: FloatArray) -> float:
    """From which vertical force (k,) on a plate is loaded that is idle too rarely for its level to be known.

    Small forces that hardly change are what it reads while nobody stands on it.
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
