"""Are the forces of all trials of a person equally delayed? Only the simultaneous estimate finds each trial's delay,
and a delayed trial may have other faults.

The vertical velocity from the markers follows the force-derived one with a delay: the synchronisation delay of the
forces, and some ms added by skin, trunk and arms, which are the same in all movements. Between trials of one person
(two walks, squats, parts of walks and runs) each of the two measures of it differs by up to 8 ms, but both in one
direction by at most 4 ms; even trials of eight people with different skin motion differ by at most 10 ms. Parts of less
than a second differ by up to 15 ms.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.vertical_acceleration import LARGEST_RESIDUAL, vertical_match_of
from kinertia.diagnostics.person_context import PersonContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.trial.sampled_time import span_s

_LEAST_WINDOW_S = 0.8
"""Parts of half a second of one trial differ by up to 40 ms."""
_SHORT_S = 1.0
_APART_S, _SHORT_APART_S = 0.012, 0.018
"""Smallest notable difference of delays, in longer windows and in shorter ones."""
_USUAL_S = (-0.004, 0.004)


class TrialDelay(NamedTuple):
    """Delay (s) of the forces of a trial by the pelvis and by the marker-based centre, and whether only short windows
    show it.
    """

    name: str
    by_pelvis_s: float
    by_markers_s: float
    short: bool = False


def trial_delay(context: RecordingContext) -> TrialDelay | None:
    """Compute the delay over all windows that are long enough; None where none is, or without movement."""
    if context.trial is None or context.travel.kind == "stands still":
        return None
    found, spans = [], []
    for part in context.velocities:
        if span_s(part.time) < _LEAST_WINDOW_S:
            continue
        both = vertical_match_of(part)
        if both and max(one.residual for one in both) <= LARGEST_RESIDUAL:
            found.append([one.delay_s for one in both])
            spans.append(span_s(part.time))
    if not found:
        return None
    pelvis, markers = np.average(found, axis=0, weights=spans)
    return TrialDelay(context.name, float(pelvis), float(markers), max(spans) < _SHORT_S)


def trial_delays(person: PersonContext) -> Iterator[Finding]:
    """Report T213: trials whose delay differs from the other trials'."""
    if len(person.trials) > 1:
        yield from uneven_delays([trial_delay(one) for one in person.trials])


def uneven_delays(delays: Sequence[TrialDelay | None]) -> Iterator[Finding]:
    """Report T213: each trial whose delay is far from the median of three and more; of two that differ both, since it
    is unknown which of them is wrong.
    """
    known = [one for one in delays if one is not None]
    if len(known) < 2:
        return
    values = np.array([[one.by_pelvis_s, one.by_markers_s] for one in known])
    usual = values[::-1] if len(known) == 2 else np.broadcast_to(np.median(values, axis=0), values.shape)
    limit_s = _SHORT_APART_S if any(one.short for one in known) else _APART_S
    for one, others, delays_s in zip(known, usual, values - usual, strict=True):
        if np.abs(delays_s).min() <= limit_s or delays_s.prod() <= 0:
            continue
        yield finding(
            "T213",
            Where(trial=one.name),
            delay_s=Quantity(float(delays_s.mean()), "s", limit=limit_s, usual=_USUAL_S),
            by_pelvis_s=Quantity(one.by_pelvis_s, "s"),
            by_markers_s=Quantity(one.by_markers_s, "s"),
            others_s=Quantity(tuple(float(each) for each in others), "s"),
        )
