"""Are the plates' signals intact? Covers dead channels, dropped and repeated samples, spikes and saturated
amplifiers."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.loaded_plates import carrying, wrenches
from kinertia.diagnostics.plates.quantisation import quantisation_n
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.centre_of_pressure import FIRM_LOAD_N
from kinertia.trial.data import BoolArray, FloatArray, PlateLoads
from kinertia.trial.force_spikes import LIMITS_N
from kinertia.trial.sampled_time import runs, span_s

_DEAD_N, _DEAD_NM = 0.5, 0.5
"""Amplifiers have more noise than this."""
_CARRIED_SHARE = 0.4
"""Share of the median load that a foot at contact or off takes several samples to gain or lose."""
_DROPPED_S = 0.06
"""The next foot does not land sooner on one plate, even in running."""
_SAME, _SATURATED_S, _FEWEST_SATURATED, _STEEP = 1e-6, 0.02, 4, 0.02
"""At the end of a range a force stays exactly the same, and comes and goes steeply."""
_FULL_RANGE_N, _FULL_RANGE_ACROSS_N = 200.0, 30.0
"""Smallest ranges of amplifiers, as forces of an adult."""
_REPEATED_S, _LONG_REPEATED_S, _FEWEST_REPEATED, _LEAP_STEPS = 0.025, 0.1, 3, 3.0
"""Loads of 25 fault-free trials never stay the same in all channels for more than 2 ms. Long repetitions shift where
contacts begin and end."""
_QUANTISED, _STEPS = 4.0, 3.2
"""A round peak that is flat for being rounded lasts at most twice as long as the next three steps on one side of it."""


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
            depth = float(force @ moment) / max(float(force @ force), 1e-9)
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
    known = {one.where.span_s for one in of_all}
    for p, name in enumerate(plates.names):
        for one in _dropped(context.at(plate=name), plates.time, vertical[:, p], silent[:, p], _DROPPED_S):
            if one.where.span_s not in known:
                yield one


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
                span_s=Quantity(lasts, "s", limit=_REPEATED_S, usual=(0.0, 0.002)),
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


def spikes(context: RecordingContext) -> Iterator[Finding]:
    """Report P109: each plate's largest spike, of those that the reader has bridged."""
    plates = context.plates
    if plates is None or plates.spikes is None:
        return
    for name, bridged in zip(plates.names, plates.spikes, strict=True):
        if bridged:
            largest = max(bridged, key=lambda one: abs(one.size_n))
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
