"""Do forces keep time with the markers, going by the body's vertical motion?

The vertical velocity from the markers equals the force-derived one, except for a factor near one: over a second it
shows a delay and its growth. Two steps suffice, where single contacts would be too few. If the rate of both is wrong,
it enters the accelerations, and so the factor, squared.
"""

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.vertical_acceleration import LARGEST_RESIDUAL, vertical_match_of
from kinertia.findings.finding import Finding, Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.trial.sampled_time import span_s

_LEAST_WINDOW_S, _LEAST_GROWTH = 1.0, 0.0105
"""By pelvis or by marker-based centre the delay of 21 fault-free trials grows by -0.017 to 0.013 in windows of 1.03 to
1.3 s and by up to 0.002 in longer ones, and by both in one direction by at most 0.004."""
_LEAST_RATIO, _MOST_RATIO, _USUAL_RATIO, _TYPICAL_RATIO = 0.4, 1.8, (0.67, 0.99), 0.9
"""On 26 fault-free trials, from squats to runs; at half the true rate it is four times as much."""


def force_rate(context: RecordingContext) -> Iterator[Finding]:
    """Report T202 and T201: a wrong rate by the velocity ratio (T202); delays that grow or shrink in a measured window
    (T201).

    Without strides the trunk bends, so that the pelvis moves differently: the marker-based centre must agree.
    """
    if context.velocity_changes is None:
        return
    yield from _wrong_rate(context)
    grows = next(_growing_delays(context), None)
    if grows is not None:
        yield grows


def _wrong_rate(context: RecordingContext) -> Iterator[Finding]:
    """Report T202, only where all of the load is known: a foot beyond its plate looks like another rate."""
    changes = context.velocity_changes_on_plates
    if changes is None:
        return
    ratio = changes.vertical_ratio(changes.pelvis)
    by_centre = ratio if context.has_strides else changes.vertical_ratio(changes.centre)
    if ratio is not None and by_centre is not None and _wrong(ratio) and _wrong(by_centre):
        yield finding(
            "T202",
            context.at(),
            # at less than the true rate forces seem to move the body faster
            rate_factor=Quantity(float(np.sqrt(_TYPICAL_RATIO / ratio)), "1"),
            velocity_ratio=Quantity(ratio, "1", limit=_MOST_RATIO if ratio > 1 else _LEAST_RATIO, usual=_USUAL_RATIO),
        )


def _wrong(ratio: float) -> bool:
    return not _LEAST_RATIO < ratio < _MOST_RATIO


def _growing_delays(context: RecordingContext) -> Iterator[Finding]:
    """Report T201: delays that grow or shrink, tested in every window."""
    trial = context.trial
    if trial is None:
        return
    for part in context.velocities:
        if span_s(part.time) < _LEAST_WINDOW_S:
            continue
        found = vertical_match_of(part, growing=True)
        if not found or max(one.residual for one in found) > LARGEST_RESIDUAL:
            continue
        # with another gain under one foot the body seems to be pushed ever earlier, or later, within two steps
        gains = vertical_match_of(part, own=part.by(trial.loads.time, trial.loads.force[:, 0, 1]))
        if any(one.residual > other.residual for one, other in zip(found, gains, strict=False)):
            continue
        delay, rate_error = np.array([one.delay_s for one in found]), np.array([one.rate_error for one in found])
        if np.abs(rate_error).min() < _LEAST_GROWTH or abs(np.sign(rate_error).sum()) < len(rate_error):
            continue
        mean = float(rate_error.mean())
        begin, end = (float(delay.mean()) + mean * half * np.ptp(part.time) / 2 for half in (-1, 1))
        yield finding(
            "T201",
            context.at(span_s=(float(part.time[0]), float(part.time[-1]))),
            Severity.WARNING,
            ratio=Quantity(1.0 / (1.0 - mean), "1"),
            delay_s=Quantity((float(begin), float(end)), "s"),
            rate_error=Quantity(mean, "1", limit=_LEAST_GROWTH, usual=(-0.004, 0.004)),
            method=Quantity("vertical velocity"),
        )
