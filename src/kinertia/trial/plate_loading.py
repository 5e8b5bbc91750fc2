"""Separates loaded from unloaded samples of a force plate, and measures the noise of the unloaded plate.

Below some 20 N the centre of pressure is a ratio of two noise signals, and a plate always reads a small force. But a
foot that lands or leaves passes through these small forces too: if they were set to zero, they would be missing from
the joint moments of the legs. So samples that join a load without a break and exceed the noise of the plate belong to
it, and act at the centre of pressure of the nearest sample with a reliable load.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinertia.trial.centre_of_pressure import centre_of_pressure
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.force_spikes import ForceSpike
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, nearest_samples, runs
from kinertia.trial.unloaded_level import UnloadedReading
from kinertia.trial.unloaded_reading import unloaded_blocks, unloaded_reading

LONGEST_TAIL_S = 0.03
"""Longest low-force phase of a landing or leaving foot; what lasts longer below the threshold is an offset."""
_ABOVE_NOISE, _LEAST_TAIL_N = 4.0, 1.0
_FEWEST_IDLE = 20
_IDLE_MOST_N, _STEADY_N = 3 * LOAD_THRESHOLD_N, 5.0
"""The level of an unloaded plate is below the first and varies by less than the second; under a landing or leaving foot
it varies more."""
_NOISY_N, _MAINS_S = 5.0, 0.02
"""With noise above the first, loads are detected in the mean over the second, one period of the mains."""
_IDLE_PERCENT, _BEYOND_IDLE, _STEP_BEYOND, _WANDERS_N = 99.0, 1.5, 2.0, 30.0
"""A load exceeds nearly all readings of the unloaded plate by the first factor, and at some time by the second; a mean
farther from the usual level is not a reading of an unloaded plate."""
_GAUSSIAN = 1.4826
"""Standard deviation of Gaussian noise over its median absolute deviation."""


class PlateLoad(NamedTuple):
    """Load of one plate with its unloaded reading subtracted.

    Force (k, 3) N, moment (k, 3) N m, noise of the vertical force (N), the reading itself, and bridged spikes.
    """

    force: FloatArray
    moment: FloatArray
    noise_n: float
    unloaded: UnloadedReading
    spikes: tuple[ForceSpike, ...] = ()


def without_unloaded_level(time: FloatArray, force: FloatArray, moment: FloatArray) -> PlateLoad:
    """Subtract the plate's unloaded reading, and set unloaded samples to zero.

    Args:
        time: (k,) s.
        force, moment: (k, 3) N and N m about the ground origin, on the person; where the force is below
            LOAD_THRESHOLD_N the moment is not used and may be anything.
    """
    unloaded = unloaded_reading(time, force, moment)
    if unloaded.off_zero:
        force, moment = unloaded.added(-1.0, force, moment)
        unloaded = unloaded._replace(subtracted=True)
    loaded = _loaded(time, force[:, 1], unloaded)
    offset_n, noise_n = _unloaded(force[~loaded, 1])
    if not loaded.any():
        return PlateLoad(np.zeros_like(force), np.zeros_like(force), noise_n, unloaded)
    firm = np.flatnonzero(loaded)
    nearest = firm[nearest_samples(time[firm], time)] if len(firm) > 1 else np.full(len(time), firm[0])
    stands_out = force[:, 1] > max(offset_n + _ABOVE_NOISE * noise_n, _LEAST_TAIL_N)
    near = np.abs(time - time[nearest]) <= LONGEST_TAIL_S + TIME_TOLERANCE_S
    tail = _joining(loaded, loaded | (stands_out & near)) & ~loaded
    point = centre_of_pressure(np.concatenate([force, moment], axis=1)[nearest])
    moment = np.where(loaded[:, None], moment, np.where(tail[:, None], np.cross(point, force), 0.0))
    return PlateLoad(np.where((loaded | tail)[:, None], force, 0.0), moment, noise_n, unloaded)


def joined(
    time: FloatArray, names: Sequence[str], feet: Sequence[str | None], plates: Sequence[PlateLoad]
) -> PlateLoads:
    """Return the loads of all plates, with their names and the feet that are declared for them."""
    return PlateLoads(
        time,
        tuple(names),
        np.stack([plate.force for plate in plates], axis=1),
        np.stack([plate.moment for plate in plates], axis=1),
        tuple(feet),
        noise_n=tuple(plate.noise_n for plate in plates),
        unloaded=tuple(plate.unloaded for plate in plates),
        spikes=tuple(plate.spikes for plate in plates),
    )


def largest_n(time: FloatArray, force: FloatArray) -> float:
    """Return the vertical force (N) farthest from the unloaded reading, of forces (k, 3), less that reading."""
    level_n = float(np.nan_to_num(unloaded_reading(time, force, np.zeros_like(force)).level_n[1]))
    return float(force[np.argmax(np.abs(force[:, 1] - level_n)), 1]) - level_n


def with_unloaded_levels(plates: PlateLoads) -> PlateLoads:
    """Return the loads as they were read, unloaded readings included, for plates that the laboratory has zeroed."""
    force, moment, readings = plates.force.copy(), plates.moment.copy(), list(plates.unloaded or ())
    for p, unloaded in enumerate(readings):
        if unloaded.subtracted:
            loaded = force[:, p, 1] != 0.0
            force[loaded, p], moment[loaded, p] = unloaded.added(1.0, force[loaded, p], moment[loaded, p])
            readings[p] = unloaded._replace(subtracted=False)
    return replace(plates, force=force, moment=moment, unloaded=tuple(readings) or plates.unloaded)


def _loaded(time: FloatArray, vertical: FloatArray, unloaded: UnloadedReading) -> BoolArray:
    """Return the mask (k,) of samples whose vertical force (k,) exceeds the reading of the unloaded plate."""
    if np.isnan(unloaded.noise_n):
        return vertical >= load_threshold_n(vertical)
    course = vertical - unloaded.remaining_n[1]
    if unloaded.noise_n > _NOISY_N:
        period = min(max(1, round(_MAINS_S / float(np.median(np.diff(time))))), len(course))
        mean = np.convolve(course, np.full(period, 1.0 / period), mode="valid")
        course = mean[np.clip(np.arange(len(course)) - period // 2, 0, len(mean) - 1)]
    blocks = course[unloaded_blocks(time, vertical)]
    usual = np.abs(blocks[np.abs(blocks.mean(axis=1)) < _WANDERS_N])
    beyond_n = _BEYOND_IDLE * float(np.percentile(usual, _IDLE_PERCENT)) if usual.size else 0.0
    threshold_n = max(LOAD_THRESHOLD_N - unloaded.remaining_n[1], LOAD_THRESHOLD_N / 2, beyond_n)
    loaded = course >= threshold_n
    if beyond_n >= threshold_n:
        for first, last in runs(loaded):
            loaded[first : last + 1] &= course[first : last + 1].max() >= _STEP_BEYOND * threshold_n
    return loaded


def load_threshold_n(vertical: FloatArray) -> float:
    """Return the vertical force (N) above which a plate is loaded, if it is unloaded too rarely to know its level.

    It is derived from the vertical force (k,) of the recording: small forces that hardly change are its unloaded
    reading.
    """
    offset_n, noise_n = _unloaded(vertical[vertical < _IDLE_MOST_N])
    if noise_n > _STEADY_N:
        return LOAD_THRESHOLD_N
    return max(LOAD_THRESHOLD_N, offset_n + max(_ABOVE_NOISE * noise_n, LOAD_THRESHOLD_N / 2))


def _joining(loaded: BoolArray, candidates: BoolArray) -> BoolArray:
    """Return the candidates (they include the loaded samples) that are connected to a loaded sample without a break."""
    run_number = np.cumsum(np.diff(candidates, prepend=False))
    return candidates & np.isin(run_number, run_number[loaded])


def _unloaded(vertical: FloatArray) -> tuple[float, float]:
    """Return offset and standard deviation (N) of an unloaded plate's reading; zero if it is hardly ever unloaded."""
    if len(vertical) < _FEWEST_IDLE:
        return 0.0, 0.0
    offset = float(np.median(vertical))
    return offset, float(_GAUSSIAN * np.median(np.abs(vertical - offset)))
