"""Separates loaded from unloaded samples of a force plate, and determines its unloaded reading and noise.

Below some 20 N the centre of pressure is a ratio of two noise signals, and a plate always reads a small force. But a
foot that lands or leaves passes through these small forces too: if they were set to zero, they would be missing from
the joint moments of the legs. So samples that join a load without a break and exceed the noise of the plate belong to
it, and act at the centre of pressure of the nearest sample with a reliable load.

On 26 recordings of nine laboratories no plate reads below zero for more than 3 ms next to a load.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.plate_signals import ForceSpike, UnloadedReading
from kinertia.trial.sampled_data import TIME_TOLERANCE_S, nearest_samples, runs, span_s

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
_PULLED_SHARE, _BESIDE_S, _WITHIN_S, _LONGEST_S, _FEWEST_BESIDE_S = 0.005, 0.04, 0.3, 0.2, 0.15
"""Share of a load's peak; largest distance from the load at which it begins; search span; longest duration: a wrong
zero, or the load of another plate, lasts longer."""
_SHORTEST_LOAD_S, _LEAST_LOAD_N, _BRIDGED_S = 0.15, 200.0, 0.05
_BLOCK_S, _FEWEST_BLOCKS = 0.1, 4
"""Block length in whole periods of the mains, of 50 and of 60 Hz, so that interference averages to zero."""
_IDLE_N, _EQUAL_BLOCKS_N, _IDLE_SHARE, _LEAST_PEAK_N = 150.0, 7.5, 0.2, 100.0
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
    level = vertical - unloaded.remaining_n[1]
    if unloaded.noise_n > _NOISY_N:
        period = min(max(1, round(_MAINS_S / float(np.median(np.diff(time))))), len(level))
        mean = np.convolve(level, np.full(period, 1.0 / period), mode="valid")
        level = mean[np.clip(np.arange(len(level)) - period // 2, 0, len(mean) - 1)]
    blocks = level[unloaded_blocks(time, vertical)]
    usual = np.abs(blocks[np.abs(blocks.mean(axis=1)) < _WANDERS_N])
    beyond_n = _BEYOND_IDLE * float(np.percentile(usual, _IDLE_PERCENT)) if usual.size else 0.0
    threshold_n = max(LOAD_THRESHOLD_N - unloaded.remaining_n[1], LOAD_THRESHOLD_N / 2, beyond_n)
    loaded = level >= threshold_n
    if beyond_n >= threshold_n:
        for first, last in runs(loaded):
            loaded[first : last + 1] &= level[first : last + 1].max() >= _STEP_BEYOND * threshold_n
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


def ringing_s(time: FloatArray, vertical: FloatArray) -> float:
    """Return for how long (s) a plate reads below zero just before foot contact and just after foot off.

    It is 0 unless both happen. A foot cannot pull on a plate, but a zero-phase filter spreads a load in this way.

    Args:
        time, vertical: (k,) s and N, as read.
    """
    peak = float(vertical.max(initial=0.0))
    if len(time) < 2 or peak < _LEAST_LOAD_N:
        return 0.0
    step = round(float(np.median(np.diff(time))), 9)
    landings: list[float] = []
    leavings: list[float] = []
    loads = _loads(vertical > LOAD_THRESHOLD_N, _BRIDGED_S / step)
    for k, (first, last) in enumerate(loads):
        if (last - first) * step < _SHORTEST_LOAD_S:
            continue
        before = slice(loads[k - 1][1] + 1 if k else 0, first)
        after = slice(last + 1, loads[k + 1][0] if k + 1 < len(loads) else len(vertical))
        for beside, found in ((vertical[before][::-1], landings), (vertical[after], leavings)):
            if len(beside) * step >= _FEWEST_BESIDE_S:
                found.append(_pulled_s(beside[: int(_WITHIN_S / step)], peak, step))
    if not landings or not leavings:
        return 0.0
    return float(min(np.median(landings), np.median(leavings)))


def _pulled_s(beside: FloatArray, peak: float, step: float) -> float:
    """Return how long (s) values (k,) beside a load, ordered outwards, are below zero; 0 if they stay there."""
    pulled = runs(beside < -_PULLED_SHARE * peak)
    if not pulled or pulled[0][0] * step > _BESIDE_S or pulled[0][1] == len(beside) - 1:
        return 0.0
    lasts_s = (pulled[0][1] - pulled[0][0] + 1) * step
    return lasts_s if lasts_s < _LONGEST_S else 0.0


def _loads(loaded: BoolArray, bridged: float) -> list[tuple[int, int]]:
    """Return the runs of loaded samples, merging runs with fewer than `bridged` samples between them."""
    joined: list[tuple[int, int]] = []
    for first, last in runs(loaded):
        if joined and first - joined[-1][1] < bridged:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


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
    steady = np.ptp(near, axis=0) < _EQUAL_BLOCKS_N
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
