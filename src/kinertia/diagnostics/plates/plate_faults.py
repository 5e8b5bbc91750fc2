"""What goes wrong with plates by themselves: axes, units, zeros, drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.trial.centre_of_pressure import FIRM_LOAD_N, free_moment
from kinertia.trial.data import LOAD_THRESHOLD_N, BoolArray, FloatArray, PlateLoads
from kinertia.trial.force_resolution import force_step_n, rounded_force_doubts
from kinertia.trial.sampled_time import runs, span_s

_LONGEST_ARM_M = 0.15
"""Free moment over vertical force; that of feet on the ground stays below 0.04 m."""
_STEP_N, _MOST_IDLE_N, _STEADY_N = 350.0, 150.0, 15.0
_ZERO_N, _FAR_FROM_ZERO_N, _DRIFT_N = 15.0, 40.0, 15.0
"""Zeroed plates read a few newtons; 40 N are 5 % of a person's weight on every plate."""
_WEAKEST_N = 0.3
_CARRIED_SHARE = 0.4
"""Of what plates carry in the middle: a foot that leaves or lands takes some samples to lose or gain so much."""
_NOTHING_N, _NOTHING_NM, _FEWEST_CARRIED = 0.5, 0.005, 10
"""Amplifiers have more noise than this; so many samples under load, at least."""
_SAME, _FLAT_S, _FEWEST_FLAT, _STEEP = 1e-6, 0.02, 4, 0.02
"""At the end of a range a force stays exactly the same, and comes and goes steeply."""
_FULL_RANGE_N, _FULL_RANGE_ACROSS_N = 200.0, 30.0
_HELD_S, _LONG_HELD_S, _FEWEST_HELD, _LEAP_STEPS = 0.025, 0.1, 3, 3.0
"""Loads of 25 sound trials never stay the same in all channels for more than 2 ms."""
_ROUNDED, _STEPS = 4.0, 3.2
"""A round peak that is flat for being rounded lasts at most twice as long as the next three steps on one side of it."""
_IDLE_PERCENT = (2.0, 15.0)
"""A plate that somebody walks over is idle for at least so many percent of the record."""


def loads_trouble(plates: PlateLoads) -> str:
    """What is wrong with the axes or units of the plates' loads by themselves; empty where nothing is."""
    peaks = np.abs(plates.force).max(axis=(0, 1), initial=0.0)
    axis = "XYZ"[int(np.argmax(peaks))]
    if axis != "Y" and peaks[1] < 0.7 * peaks.max():
        return (
            f"the largest forces point along {axis} ({peaks.max():.0f} N) and not along Y ({peaks[1]:.0f} N), which is "
            f"up in the markers; export forces and markers in the same axes"
        )
    if trouble := _lost_samples(plates) or _far_from_zero(plates) or _never_unloaded(plates) or _hardly_loaded(plates):
        return trouble
    if held := _held_samples(plates, _LONG_HELD_S):
        return held[0]
    arms = np.abs(free_moment(plates.wrench))[plates.force[..., 1] > FIRM_LOAD_N]
    arms /= plates.force[..., 1][plates.force[..., 1] > FIRM_LOAD_N]
    typical = float(np.median(arms)) if arms.size else 0.0
    if typical > _LONGEST_ARM_M:
        return (
            f"the torques are those of vertical forces at {typical:.2g} m from the foot; expected less than 0.04 m: "
            f"they are in N mm, or not about the centre of pressure; export them in N m, about the point of the force"
        )
    return ""


def loads_doubts(plates: PlateLoads) -> list[str]:
    """Saturated amplifiers; zeros that are wrong or drift, by what plates read while nobody stands on them."""
    doubts = _dead_channels(plates) + _without_free_moment(plates)
    doubts += rounded_force_doubts(plates) or _held_samples(plates) or _saturated(plates)
    if plates.idle is None:
        return doubts
    for name, idle in zip(plates.names, plates.idle, strict=True):
        drifts = abs(idle.drift_n) > _DRIFT_N
        if drifts:
            doubts.append(
                f"the zero of {name} drifts: its vertical force changes by {idle.drift_n:+.0f} N over the recording "
                "while nobody stands on it; let the amplifiers warm up and zero them before each trial, or take the "
                "drift off"
            )
        level = [(axis, value) for axis, value in zip("XYZ", idle.level_n, strict=True) if abs(value) > _ZERO_N]
        off = [(axis, value) for axis, value in level if not (drifts and axis == "Y")]
        if off:
            doubts.append(_wrong_zero(name, off))
    return doubts


def _dead_channels(plates: PlateLoads) -> list[str]:
    """Horizontal axes along which a plate that carries a person shows nothing at all."""
    doubts = []
    for name, wrench in _carried(plates):
        dead = [axis for axis, values in (("X", wrench[:, 0]), ("Z", wrench[:, 2])) if _shows_nothing(values)]
        if dead:
            doubts.append(
                f"{name} carries up to {wrench[:, 1].max():.0f} N and shows no force along {' and '.join(dead)} in any "
                "sample: a channel is dead, or was not exported; a foot pushes sideways by tens of newtons, and joint "
                "moments are wrong by tens of N m without"
            )
    return doubts


def _without_free_moment(plates: PlateLoads) -> list[str]:
    """Plates that carry a person and show no moment about the vertical through the centre of pressure."""
    without = [name for name, wrench in _carried(plates) if np.abs(free_moment(wrench)).max() < _NOTHING_NM]
    if not without:
        return []
    return [
        f"no free moment (torque about the vertical) is in the loads of {', '.join(without)}: it was not exported, or "
        "not measured, and counts as zero; feet twist against the ground by some N m: moments of hip adduction, of "
        "rotations and of the subtalar joints, and centres of mass to the side, are off by more than their error bars "
        "say; export the torques, too"
    ]


def _carried(plates: PlateLoads) -> Iterator[tuple[str, FloatArray]]:
    """Name and wrench (j, 6) under load, of every plate that carries a person."""
    for name, wrench in zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True):
        carried = wrench[wrench[:, 1] > FIRM_LOAD_N]
        if len(carried) >= _FEWEST_CARRIED and carried[:, 1].max() >= _STEP_N:
            yield name, carried


def _lost_samples(plates: PlateLoads) -> str:
    """The first stretch in which all plates read nothing, between samples that carry a person; empty without one."""
    total = plates.force[..., 1].sum(axis=1)
    carried = total[total > FIRM_LOAD_N]
    much = _CARRIED_SHARE * float(np.median(carried)) if carried.size else np.inf
    for first, last in runs(np.equal(np.abs(plates.force).sum(axis=(1, 2)), 0.0)):
        before, after = total[max(first - 1, 0)], total[min(last + 1, len(total) - 1)]
        if min(before, after) > much:
            return (
                f"all plates read zero from {plates.time[first]:.3f} to {plates.time[last]:.3f} s, between samples of "
                f"{before:.0f} and {after:.0f} N: nobody leaves the ground like that; samples were lost or filled with "
                "zeros: export the forces again"
            )
    return ""


def _shows_nothing(values: FloatArray) -> bool:
    return bool(np.abs(values).max() < _NOTHING_N)


def _saturated(plates: PlateLoads) -> list[str]:
    """Forces that reach their largest value along an axis and stay there, where a foot's would have gone on."""
    doubts = []
    for name, force in zip(plates.names, np.moveaxis(plates.force, 1, 0), strict=True):
        # upwards a person weighs; sideways a foot pushes as hard one way as the other
        values = {"vertical force": force[:, 1], "force along X": force[:, 0], "force along Z": force[:, 2]}
        for what, one in values.items():
            for signed in (one,) if what == "vertical force" else (one, -one):
                top = float(signed.max(initial=0.0))
                lasted = _lasts_at_top(plates.time, signed, top)
                if top > (_FULL_RANGE_N if what == "vertical force" else _FULL_RANGE_ACROSS_N) and lasted:
                    doubts.append(
                        f"the {what} of {name} stays at {one[int(np.argmax(signed))]:.1f} "
                        f"N, its largest value, for up to {1e3 * lasted:.0f} ms: its amplifier or converter is at the "
                        "end of its range, and more was there than it shows; choose a larger range and record the "
                        "trial again, or use one without such a step"
                    )
    return doubts


def _lasts_at_top(time: FloatArray, values: FloatArray, top: float) -> float:
    """How long (s) values (k,) stay exactly at their largest, having come there steeply; 0 where they do not."""
    flat = [
        (first, last)
        for first, last in runs(values >= top * (1.0 - _SAME))
        if last - first >= _FEWEST_FLAT and span_s(time, first, last) >= _FLAT_S
        if top - values[max(2 * first - last, 0)] > _STEEP * top
    ]
    if (step := force_step_n(values[values != 0.0])) > 0.0:
        near = values >= top - _STEPS * step
        beside = [max(_as_long(near[:a][::-1]), _as_long(near[b + 1 :])) for a, b in flat]
        flat = [(a, b) for (a, b), lasts in zip(flat, beside, strict=True) if b - a > _ROUNDED * (lasts + 1)]
    return max((float(time[last] - time[first]) for first, last in flat), default=0.0)


def _as_long(mask: BoolArray) -> int:
    """With how many True a mask (k,) begins."""
    return len(mask) if mask.all() else int(np.argmin(mask))


def _held_samples(plates: PlateLoads, least_s: float = _HELD_S) -> list[str]:
    """Stretches in which a plate that carries somebody reads exactly the same, in all its channels, for so long."""
    doubts = []
    for name, wrench in zip(plates.names, np.moveaxis(plates.wrench, 1, 0), strict=True):
        same = np.equal(np.diff(wrench, axis=0), 0.0).all(axis=1) & (wrench[1:, 1] > FIRM_LOAD_N)
        # forces that are rounded stay, and go on by one step; before late ones a file may be filled up with the first
        leap = _LEAP_STEPS * float(np.diff(np.unique(wrench[:, 1])).min(initial=np.inf))
        held = [
            (float(plates.time[first]), float(plates.time[last + 1]))
            for first, last in runs(same)
            if first > 0 and last - first + 1 >= _FEWEST_HELD and span_s(plates.time, first, last + 1) >= least_s
            if last + 2 < len(wrench) and abs(wrench[last + 2, 1] - wrench[last, 1]) > leap
        ]
        if held:
            start, end = max(held, key=lambda span: span[1] - span[0])
            doubts.append(
                f"{name} reads exactly the same in all its channels from {start:.3f} to {end:.3f} s, under load: "
                "samples were lost and the last one was repeated, or a gap was filled with it; export the forces "
                "again, or leave this trial out"
            )
    return doubts


def _wrong_zero(name: str, off: Sequence[tuple[str, float]]) -> str:
    offsets = ", ".join(f"{value:+.0f} N along {axis}" for axis, value in off)
    vertical = any(axis == "Y" for axis, _ in off)
    which = "the zero of its vertical force" if vertical else "the zero of that axis"
    return (
        f"{name} reads {offsets} while nobody stands on it: {which} is wrong, and the loads are off by as much; zero "
        f"the plates without load, or subtract it before export"
    )


def _far_from_zero(plates: PlateLoads) -> str:
    """A plate whose vertical force is off by so much that the body's mass is."""
    for name, idle in zip(plates.names, plates.idle or (), strict=plates.idle is not None):
        if abs(idle.level_n[1]) > _FAR_FROM_ZERO_N and not abs(idle.drift_n) > _DRIFT_N:
            return _wrong_zero(name, [("Y", idle.level_n[1])])
    return ""


def _never_unloaded(plates: PlateLoads) -> str:
    """Which plate somebody walked over shows a small steady force where others show none; empty where none does."""
    drifts = [abs(idle.drift_n) > _DRIFT_N for idle in plates.idle or ()] or [False] * len(plates.names)
    for name, vertical, drifting in zip(plates.names, plates.force[..., 1].T, drifts, strict=True):
        if drifting:
            continue
        low, high = np.percentile(vertical, _IDLE_PERCENT)
        steady = high - low < _STEADY_N
        if vertical.max() > _STEP_N and low > LOAD_THRESHOLD_N and high < _MOST_IDLE_N and steady:
            return (
                f"{name} never shows less than {vertical.min():.0f} N, and a steady {(low + high) / 2:.0f} N while "
                "nobody stands on it: the zero of its vertical force is wrong, or drifts; zero the plates without "
                "load, or subtract it before export"
            )
    return ""


def _hardly_loaded(plates: PlateLoads) -> str:
    """What all plates show is too little for a person, and more than noise."""
    peak = max((idle.peak_n for idle in plates.idle or ()), default=np.inf)
    if not _WEAKEST_N < peak < LOAD_THRESHOLD_N or plates.force.any():
        return ""
    return (
        f"the largest vertical force is {peak:.2g}: the forces are in kN, or in multiples of the body weight; export "
        "them in N"
    )
