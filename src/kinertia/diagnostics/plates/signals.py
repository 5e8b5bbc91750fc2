"""Are the plates' signals intact? Dead channels, dropped samples, spikes, saturation, rounding, mains interference.

On 26 recordings of nine laboratories forces have steps of 4.9 N at most (one plate behind a 12-bit converter), and no
plate reads negative forces for more than 3 ms next to a load.

On 26 recordings of nine laboratories the forces have at most 0.9 N at 50 or 60 Hz, at most 3.4 times as much as 10 to
16 Hz away (taken as 0.2 N at least): impacts contain all frequencies equally.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.force_mass import ADULT_KG, STEP_N, carrying, loaded_wrenches, wrenches
from kinertia.diagnostics.runner import NEEDS_VERTICAL_FORCE, check
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.motion.ground_reactions import load_bandwidth_hz
from kinertia.trial.data import BoolArray, FloatArray, PlateLoads
from kinertia.trial.ground_contact import FIRM_LOAD_N, centre_of_pressure
from kinertia.trial.plate_signals import LIMITS_N, LONGEST_S
from kinertia.trial.sampled_data import runs, span_s

_DEAD_N, _DEAD_NM, _DEEPEST_M = Limit(0.5, "N"), Limit(0.5, "N m"), 0.1
"""Amplifiers have more noise than the former; transducers are 20 to 60 mm below the surface."""
_CARRIED_SHARE = Limit(0.4)
"""Share of the median load that a foot at contact or off takes several samples to gain or lose."""
_DROPPED_S = Limit(0.06, "s")
"""The next foot does not land sooner on one plate, even in running."""
_SAME, _SATURATED_S, _FEWEST_SATURATED, _STEEP = 1e-6, Limit(0.02, "s"), 4, 0.02
"""At the end of a range a force stays exactly the same, and comes and goes steeply."""
_FULL_RANGE_N, _FULL_RANGE_ACROSS_N = 200.0, 30.0
"""Smallest ranges of amplifiers, as forces of an adult."""
_REPEATED_S, _LONG_REPEATED_S = Limit(0.025, "s", usual=(0.0, 0.002)), Limit(0.1, "s")
_FEWEST_REPEATED, _LEAP_STEPS = 3, 3.0
"""Loads of 25 fault-free trials never stay the same in all channels for more than 2 ms. Long repetitions shift where
contacts begin and end."""
_QUANTISED, _STEPS = 4.0, 3.2
"""A round peak that is flat for being rounded lasts at most twice as long as the next three steps on one side of it."""
_COARSE_N, _COARSE_M = Limit(7.5, "N", usual=(0.0, 4.9)), Limit(0.0075, "m")
"""Steps of 5 N, or of 5 mm, change joint moments by less than their SDs; of 10 N, or 10 mm, by up to twice
those."""
_FEWEST_SAMPLES, _FEWEST_VALUES, _OFF_STEP, _DECIMALS_N, _DECIMALS_M = 20, 3, 0.01, 3, 5
_OVERSHOOT_S, _OVERSHOOT_HZ_S = Limit(0.06, "s", usual=(0.0, 0.003)), 0.45
"""A Butterworth filter of second order, forth and back, overshoots for 0.06 s at 7 Hz and for 0.09 s at 5 Hz."""
_FILTERED_HZ = Limit(10.0, "Hz", usual=(20.0, 45.0))
"""Of 50 recordings one is below, a walk whose unloaded plates show the overshoot of a filter at 9.9 Hz. After a filter
at 10 Hz 60 % of 37 recordings are, after one at 8 Hz 95 %, at 15 Hz none. Two walks that come with OpenSim have 10.4
and 11.5 Hz: a filter, or somebody who lands softly (`ground_reactions.BLURRED_HZ`)."""
_MAINS_HZ = (50.0, 60.0)
_BESIDE_HZ = (-16.0, -13.0, -10.0, 10.0, 13.0, 16.0)
_HUM_N, _BESIDE_N, _STANDS_OUT = Limit(4.0, "N", usual=(0.0, 0.9)), 0.2, Limit(6.0)
_LOUD_N, _FILTERED = Limit(15.0, "N"), 2.0
"""This amplitude crosses the load threshold several times at contact and off, unless the unloaded plate shows it:
then its noise sets the threshold, and forces are low-passed. In a measured walk, 20 and 71 N at 50 Hz then change leg
moments by 1 to 1.4 SD (RMS), and by up to 29 N m at foot contact."""
_SHORTEST_S, _SAMPLES_PER_PERIOD, _SLOW_ORDER = 0.2, 3.0, 6


@check(
    "P101",
    "P102",
    "P103",
    "P104",
    "P109",
    unless=NEEDS_VERTICAL_FORCE,
    dead=_DEAD_N,
    step=STEP_N,
    adult=ADULT_KG,
    dropped=_DROPPED_S,
    carried=_CARRIED_SHARE,
    repeated=_REPEATED_S,
    long=_LONG_REPEATED_S,
    saturated=_SATURATED_S,
)
def signals(context: RecordingContext) -> Iterator[Finding]:
    """Report P101 to P104 and P109: faulty signals of every plate and axis."""
    if context.plates is None:
        return
    for detect in (_dead_channels, _dropped_samples, _repeated_samples, _saturated):
        yield from detect(context, context.plates)
    yield from spikes(context)


def _dead_channels(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Find horizontal axes along which a plate that supports a person reads nothing at all."""
    for name, wrench in carrying(plates, context.adult_share):
        for axis in (0, 2):
            largest = float(np.abs(wrench[:, axis]).max())
            if largest < _DEAD_N:
                yield finding(
                    "P101",
                    context.at(plate=name, **context.along(axis)),
                    peak_horizontal_n=Quantity(largest, "N", limit=_DEAD_N),
                    peak_vertical_n=Quantity(float(wrench[:, 1].max()), "N"),
                )


@check("P111", unless=NEEDS_VERTICAL_FORCE, dead=_DEAD_NM, step=STEP_N, adult=ADULT_KG)
def dead_moments(context: RecordingContext) -> Iterator[Finding]:
    """Report P111: a horizontal axis about whose middle a plate that supports a person has no moment; readers add to
    that of its channel the horizontal force times the depth of the transducers."""
    plates, corners = context.plates, None if context.plates is None else context.plates.corners
    if plates is None or corners is None:
        return
    for name, wrench in carrying(plates, context.adult_share):
        p = plates.names.index(name)
        middle, edges = corners[p].mean(axis=0), corners[p][[1, 3]] - corners[p][0]
        about = wrench[:, 3:] - np.cross(middle, wrench[:, :3])
        for edge in edges / np.linalg.norm(edges, axis=1, keepdims=True):
            moment, force = about @ edge, wrench[:, :3] @ np.cross([0.0, 1.0, 0.0], edge)
            depth = float(np.clip(force @ moment / max(float(force @ force), 1e-9), -_DEEPEST_M, _DEEPEST_M))
            largest = float(np.abs(moment - depth * force).max())
            if largest < _DEAD_NM:
                axis = int(np.argmax(np.abs(edge)))
                yield finding(
                    "P111",
                    context.at(plate=name, **context.along(axis)),
                    peak_nm=Quantity(largest, "N m", limit=_DEAD_NM),
                    peak_vertical_n=Quantity(float(wrench[:, 1].max()), "N"),
                )


def _dropped_samples(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Find intervals in which all plates, or one, read nothing between samples that support a person."""
    vertical, silent = plates.force[..., 1], np.equal(np.abs(plates.force).sum(axis=2), 0.0)
    of_all = list(_dropped(context.at(), plates.time, vertical.sum(axis=1), np.asarray(silent.all(axis=1))))
    yield from of_all
    known = {dropped.where.span_s for dropped in of_all}
    for p, name in enumerate(plates.names):
        for dropped in _dropped(context.at(plate=name), plates.time, vertical[:, p], silent[:, p], _DROPPED_S):
            if dropped.where.span_s not in known:
                yield dropped


def _dropped(
    where: Where, time: FloatArray, vertical: FloatArray, silent: BoolArray, longest_s: float = np.inf
) -> Iterator[Finding]:
    """Find intervals in which a plate, or all, are silent (k,) between samples of much of their usual force (k,)."""
    carried = vertical[vertical > FIRM_LOAD_N]
    much = _CARRIED_SHARE * float(np.median(carried)) if carried.size else np.inf
    for first, last in runs(silent):
        before, after = (float(vertical[k]) for k in (max(first - 1, 0), min(last + 1, len(vertical) - 1)))
        if min(before, after) > much and span_s(time, first, last) <= longest_s:
            yield finding(
                "P102",
                replace(where, span_s=(float(time[first]), float(time[last]))),
                before_n=Quantity(before, "N", limit=much),
                after_n=Quantity(after, "N", limit=much),
            )


def _repeated_samples(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Find the longest interval in which a plate that supports a person repeats its reading exactly in all channels."""
    for name, wrench in wrenches(plates):
        same = np.equal(np.diff(wrench, axis=0), 0.0).all(axis=1) & (wrench[1:, 1] > FIRM_LOAD_N)
        # forces that are rounded stay, and go on by one step; before late ones a file may be filled up with the first
        leap = _LEAP_STEPS * float(np.diff(np.unique(wrench[:, 1])).min(initial=np.inf))
        repeated = [
            (float(plates.time[first]), float(plates.time[last + 1]))
            for first, last in runs(same)
            if first > 0 and last - first + 1 >= _FEWEST_REPEATED
            if span_s(plates.time, first, last + 1) >= _REPEATED_S
            if last + 2 < len(wrench) and abs(wrench[last + 2, 1] - wrench[last, 1]) > leap
        ]
        if repeated:
            start, end = max(repeated, key=lambda span: span[1] - span[0])
            lasts = round(end - start, 6)
            yield finding(
                "P103",
                context.at(plate=name, span_s=(start, end)),
                Severity.ERROR if lasts >= _LONG_REPEATED_S else None,
                span_s=Quantity(lasts, "s", limit=_REPEATED_S, usual=_REPEATED_S.usual),
            )


def _saturated(context: RecordingContext, plates: PlateLoads) -> Iterator[Finding]:
    """Find forces that stay at their largest value along an axis where the force of a foot would rise further."""
    for name, wrench in wrenches(plates):
        for axis, least in enumerate((_FULL_RANGE_ACROSS_N, _FULL_RANGE_N, _FULL_RANGE_ACROSS_N)):
            # vertical forces have one sign; sideways a foot pushes equally hard both ways
            for sign in (1.0,) if axis == 1 else (1.0, -1.0):
                signed = sign * wrench[:, axis]
                top = float(signed.max(initial=0.0))
                span = _at_top(plates.time, signed, top)
                if span is not None and top > least * context.adult_share:
                    yield finding(
                        "P104",
                        context.at(plate=name, span_s=span, **context.along(axis)),
                        level_n=Quantity(sign * top, "N"),
                        span_s=Quantity(span[1] - span[0], "s", limit=_SATURATED_S),
                    )


@check("P109", vertical=Limit(LIMITS_N[1], "N"), horizontal=Limit(LIMITS_N[0], "N"), lasts=Limit(LONGEST_S, "s"))
def spikes(context: RecordingContext) -> Iterator[Finding]:
    """Report P109: each plate's largest spike, of those that the reader has bridged."""
    plates = context.plates
    if plates is None or plates.spikes is None:
        return
    for name, bridged in zip(plates.names, plates.spikes, strict=True):
        if bridged:
            largest = max(bridged, key=lambda spike: abs(spike.size_n))
            yield finding(
                "P109",
                context.at(plate=name, span_s=(largest.time_s, largest.time_s), **context.along(largest.axis)),
                size_n=Quantity(largest.size_n, "N", limit=LIMITS_N[largest.axis]),
                spikes=Quantity(len(bridged)),
            )


def _at_top(time: FloatArray, values: FloatArray, top: float) -> tuple[float, float] | None:
    """Find the longest interval (s) in which values (k,) stay exactly at their largest after a steep rise."""
    flat = [
        (first, last)
        for first, last in runs(values >= top * (1.0 - _SAME))
        if last - first >= _FEWEST_SATURATED and span_s(time, first, last) >= _SATURATED_S
        if top - values[max(2 * first - last, 0)] > _STEEP * top
    ]
    if (step := quantisation_n(values[values != 0.0])) > 0.0:
        near = values >= top - _STEPS * step
        beside = [max(_as_long(near[:a][::-1]), _as_long(near[b + 1 :])) for a, b in flat]
        flat = [(a, b) for (a, b), lasts in zip(flat, beside, strict=True) if b - a > _QUANTISED * (lasts + 1)]
    spans = [(float(time[first]), float(time[last])) for first, last in flat]
    return max(spans, key=lambda span: span[1] - span[0], default=None)


def _as_long(mask: BoolArray) -> int:
    """Count the True values at the beginning of a mask (k,)."""
    return len(mask) if mask.all() else int(np.argmin(mask))


@check("P105", "P106", unless=NEEDS_VERTICAL_FORCE, force_step=_COARSE_N, cop_step=_COARSE_M)
def quantisation(context: RecordingContext) -> Iterator[Finding]:
    """Report P105 and P106: forces, or centres of pressure, in coarse steps."""
    plates = context.plates
    if plates is None:
        return
    for name, wrench in loaded_wrenches(plates):
        step_n = max(quantisation_n(values) for values in wrench[:, :3].T)
        if step_n > _COARSE_N:
            yield finding(
                "P105", context.at(plate=name), step_n=Quantity(step_n, "N", limit=_COARSE_N, usual=_COARSE_N.usual)
            )
        point = centre_of_pressure(wrench)
        step_m = max(_step(point[:, axis], _DECIMALS_M) for axis in (0, 2))
        if step_m > _COARSE_M:
            yield finding("P106", context.at(plate=name), step_m=Quantity(step_m, "m", limit=_COARSE_M))


@check("P108", unless=NEEDS_VERTICAL_FORCE, cutoff=_FILTERED_HZ, overshoot=_OVERSHOOT_S)
def low_passed(context: RecordingContext) -> Iterator[Finding]:
    """Report P108: forces spread in time by a filter, by its overshoot or by what contacts lack."""
    plates = context.plates
    if plates is None:
        return
    overshoot_s = max((reading.overshoot_s for reading in plates.unloaded or ()), default=0.0)
    bandwidth_hz = load_bandwidth_hz(plates.time, plates.force[..., 1])
    cutoffs_hz = [] if bandwidth_hz is None else [bandwidth_hz]
    cutoffs_hz += [_OVERSHOOT_HZ_S / overshoot_s] if overshoot_s > _OVERSHOOT_S else []
    if cutoffs_hz and (cutoff_hz := min(cutoffs_hz)) < _FILTERED_HZ:
        yield finding(
            "P108",
            context.at(),
            cutoff_hz=Quantity(cutoff_hz, "Hz", limit=_FILTERED_HZ, usual=_FILTERED_HZ.usual),
            overshoot_s=Quantity(overshoot_s, "s", limit=_OVERSHOOT_S, usual=_OVERSHOOT_S.usual),
        )


def quantisation_n(values: FloatArray) -> float:
    """Return the quantisation step of forces (k,) along one axis, less their zero; 0 where they are continuous."""
    return _step(values, _DECIMALS_N)


def _step(values: FloatArray, decimals: int) -> float:
    distinct = np.unique(np.round(values, decimals))
    if len(values) < _FEWEST_SAMPLES or len(distinct) < _FEWEST_VALUES:
        return 0.0
    step = float(np.diff(distinct).min())
    steps = (distinct - distinct[0]) / step
    return step if np.abs(steps - np.round(steps)).max() < _OFF_STEP else 0.0


@check("P107", unless=NEEDS_VERTICAL_FORCE, amplitude=_HUM_N, times=_STANDS_OUT, loud=_LOUD_N)
def mains_interference(context: RecordingContext) -> Iterator[Finding]:
    """Report P107: mains interference of every plate and axis, at the stronger of the two mains frequencies."""
    plates = context.plates
    if plates is None:
        return
    noises_n = plates.noise_n or (0.0,) * len(plates.names)
    for p, name in enumerate(plates.names):
        rows = _longest_load(plates, p)
        if rows is None:
            continue
        hums = np.array([_hum_n(plates.time[rows], plates.force[rows, p], mains_hz) for mains_hz in _MAINS_HZ])
        for axis, (amplitude_n, mains_hz) in enumerate(zip(hums.max(axis=0), hums.argmax(axis=0), strict=True)):
            if amplitude_n > _HUM_N:
                yield finding(
                    "P107",
                    context.at(plate=name, **context.along(axis)),
                    Severity.ERROR if amplitude_n > max(_LOUD_N, _FILTERED * noises_n[p]) else None,
                    amplitude_n=Quantity(float(amplitude_n), "N", limit=_HUM_N, usual=_HUM_N.usual),
                    frequency_hz=Quantity(_MAINS_HZ[mains_hz], "Hz"),
                )


def _longest_load(plates: PlateLoads, p: int) -> slice | None:
    """Return the rows of the longest load of a plate; None where it is short or slowly sampled."""
    if len(plates.time) < 2:
        return None
    rate_hz = 1.0 / float(np.median(np.diff(plates.time)))
    loads = runs(plates.force[:, p, 1] > FIRM_LOAD_N)
    if not loads or rate_hz < _SAMPLES_PER_PERIOD * max(_MAINS_HZ):
        return None
    first, last = max(loads, key=lambda span: span[1] - span[0])
    return slice(first, last + 1) if (last - first) / rate_hz >= _SHORTEST_S else None


def _hum_n(time: FloatArray, force: FloatArray, mains_hz: float) -> FloatArray:
    """Return the amplitude (3,) N at this frequency in a force (k, 3); 0 along axes where neighbours are as strong."""
    hum, *beside = _amplitudes(time, force, mains_hz + np.array([0.0, *_BESIDE_HZ]))
    stands_out = hum > _STANDS_OUT * np.max([*beside, np.full(3, _BESIDE_N)], axis=0)
    return np.where(stands_out, hum, 0.0)


def _amplitudes(time: FloatArray, forces: FloatArray, frequencies_hz: FloatArray) -> FloatArray:
    """Return amplitudes (f, 3) N at these frequencies in forces (k, 3), less slow changes."""
    after = 2.0 * (time - time.mean()) / float(np.ptp(time))
    slow = np.polynomial.chebyshev.chebvander(after, _SLOW_ORDER)
    rest = forces - slow @ np.linalg.lstsq(slow, forces, rcond=None)[0]
    weight = np.hanning(len(time))
    turning = np.exp(-2j * np.pi * np.outer(frequencies_hz, time))
    result: FloatArray = 2.0 * np.abs(turning @ (weight[:, None] * rest)) / weight.sum()
    return result
