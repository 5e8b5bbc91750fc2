"""T20 and T21, do forces keep time with the markers? Do events of the file, and the belt's speed, fit the feet?

The vertical velocity from the markers follows the force-derived one with a delay: the synchronisation delay of the
forces, and some ms added by skin, trunk and arms, which are the same in all movements. Between trials of one person
(two walks, squats, parts of walks and runs) each of the two measures of it differs by up to 8 ms, but both in one
direction by at most 4 ms; even trials of eight people with different skin motion differ by at most 10 ms. Parts of less
than a second differ by up to 15 ms.

Plates of two makers may be recorded through different devices. A delayed plate takes over the body's weight too late
and keeps it too long: the sum of all forces is too small at one step and too large at the next. On 22 fault-free walks
and runs plates differ by up to 5 ms, and by 10 and 13 ms where this explains almost nothing; one plate that is 20 or 30
ms late shows 15 to 40 ms in all but two of 27. A foot over the edge of a plate also looks late or early, but only at
one end of its step, while the forces of a late plate are late from beginning to end.

The vertical velocity from the markers equals the force-derived one, except for a factor near one: over a second it
shows a delay and its growth. Two steps suffice, where single contacts would be too few. If the rate of both is wrong,
it enters the accelerations, and so the factor, squared.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from kinertia.diagnostics.context import PersonContext, RecordingContext
from kinertia.diagnostics.evidence.body_motion import (
    LARGEST_RESIDUAL,
    LONG_WINDOW_S,
    NEAR_END_S,
    ForceVelocity,
    joined_without_trend,
    vertical_match_of,
)
from kinertia.diagnostics.evidence.foot_trajectories import LEAST_BELT_M_S, standing_speeds
from kinertia.diagnostics.runner import NEEDS_VELOCITY, check
from kinertia.findings.finding import Finding, Severity, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.trial.data import FEET, FloatArray, Trial
from kinertia.trial.file_contents import GaitEvent
from kinertia.trial.ground_contact import FIRM_LOAD_N
from kinertia.trial.plate_assignment import FOOT_NAMES
from kinertia.trial.sampled_data import span_s
from kinertia.trial.stances import (
    EVENT_LIMIT_S,
    contradicted_events,
    counted_from_first_frame,
    events_of_other_foot,
    gait_events,
    sides_exchanged,
)

_LEAST_WINDOW_S = 0.8
"""Parts of half a second of one trial differ by up to 40 ms."""
_SHORT_S = Limit(1.0, "s")
_APART_S, _SHORT_APART_S = Limit(0.012, "s", usual=(-0.004, 0.004)), Limit(0.018, "s")
"""Smallest notable difference of delays, in longer windows and in shorter ones."""
_LEAST_PLATE_WINDOW_S = 0.6
_DIFFERENCE_S = Limit(0.012, "s", usual=(-0.005, 0.005))
_EXPLAINS, _CLEARLY_BEST = 0.65, 0.85
"""Shares of the residual with one delay for all plates, and of that with a gain error of each plate, that may be left.
On fault-free recordings 0.70 of the former and more are."""
_BOTH_ENDS, _UNEQUAL_S = 0.4, 0.02
"""While its force grows and while it falls, a late plate lags by at least this share of the difference; the two delays
of the other plate differ by no more than this. On nine walks this holds for every late plate that meets the other
limits, and for no plate with a simulated foot 10 to 30 mm over its edge."""
_LEAST_RATE_WINDOW_S, _LEAST_GROWTH = 1.0, Limit(0.0105, usual=(-0.004, 0.004))
"""By pelvis or by marker-based centre the delay of 21 fault-free trials grows by -0.017 to 0.013 in windows of 1.03 to
1.3 s and by up to 0.002 in longer ones, and by both in one direction by at most 0.004. In windows shorter than
LONG_WINDOW_S that reach the ends of the recording they grow by up to 0.029, in longer ones by at most 0.0065."""
_LEAST_RATIO, _MOST_RATIO, _TYPICAL_RATIO = Limit(0.4, usual=(0.67, 0.99)), Limit(1.8), 0.9
"""On 26 fault-free trials, from squats to runs; at half the true rate it is four times as much."""
_APART = Limit(0.25)
"""Share by which a stated speed may differ from the one of standing feet, which roll."""
_KM_H = 3.6


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
        if both and max(match.residual for match in both) <= LARGEST_RESIDUAL:
            found.append([match.delay_s for match in both])
            spans.append(span_s(part.time))
    if not found:
        return None
    pelvis, markers = np.average(found, axis=0, weights=spans)
    return TrialDelay(context.name, float(pelvis), float(markers), max(spans) < _SHORT_S)


@check("T213", delay=_APART_S, short=_SHORT_APART_S, window=_SHORT_S)
def trial_delays(person: PersonContext) -> Iterator[Finding]:
    """Report T213: trials whose delay differs from the other trials'."""
    if len(person.trials) > 1:
        yield from uneven_delays([trial_delay(trial) for trial in person.trials])


def uneven_delays(delays: Sequence[TrialDelay | None]) -> Iterator[Finding]:
    """Report T213: each trial whose delay is far from the median of three and more; of two that differ both, since it
    is unknown which of them is wrong.
    """
    known = [delay for delay in delays if delay is not None]
    if len(known) < 2:
        return
    values = np.array([[delay.by_pelvis_s, delay.by_markers_s] for delay in known])
    usual = values[::-1] if len(known) == 2 else np.broadcast_to(np.median(values, axis=0), values.shape)
    limit_s = _SHORT_APART_S if any(delay.short for delay in known) else _APART_S
    for delay, others, delays_s in zip(known, usual, values - usual, strict=True):
        if np.abs(delays_s).min() <= limit_s or delays_s.prod() <= 0:
            continue
        yield finding(
            "T213",
            Where(trial=delay.name),
            delay_s=Quantity(float(delays_s.mean()), "s", limit=limit_s, usual=_APART_S.usual),
            by_pelvis_s=Quantity(delay.by_pelvis_s, "s"),
            by_markers_s=Quantity(delay.by_markers_s, "s"),
            others_s=Quantity(tuple(float(other) for other in others), "s"),
        )


@check("T216", unless=NEEDS_VELOCITY, difference=_DIFFERENCE_S)
def plate_delay(context: RecordingContext) -> Iterator[Finding]:
    """Report T216: each plate with a delay of its own explains the vertical velocity, and neither one for all nor gains
    do."""
    plates, parts = (
        context.plates,
        [velocity for velocity in context.velocities if span_s(velocity.time) >= _LEAST_PLATE_WINDOW_S],
    )
    if plates is None or not parts or not context.has_strides:
        return
    used = np.flatnonzero(plates.force[..., 1].max(axis=0) > FIRM_LOAD_N)
    if len(used) < 2:
        return
    time, vertical = plates.time, plates.force[:, used, 1]
    off = joined_without_trend(parts, [(part.pelvis + part.centre)[:, 1] / 2 - part.by_forces[:, 1] for part in parts])
    pushed = _accelerations(parts, time, vertical)
    by_forces = np.stack(
        [joined_without_trend(parts, [part.by(time, plate_force) for part in parts]) for plate_force in vertical.T],
        axis=1,
    )
    delays_s, separately = _fitted(pushed, off)
    _, together = _fitted(pushed.sum(axis=1, keepdims=True), off)
    _, gains = _fitted(by_forces, off)
    late, early = int(np.argmax(delays_s)), int(np.argmin(delays_s))
    difference_s = float(delays_s[late] - delays_s[early])
    if difference_s <= _DIFFERENCE_S or separately > _EXPLAINS * together or separately > _CLEARLY_BEST * gains:
        return
    named, other = (plates.names[used[p]] for p in (late, early))
    if {named, other} & context.plates_reached_beyond:
        return
    growing, falling = (_accelerations(parts, time, change) for change in _changes(vertical))
    ends_s = _fitted(np.hstack([growing, falling]), off)[0].reshape(2, -1)
    if not _late_at_both_ends(ends_s[:, late], ends_s[:, early]):
        return
    yield with_evidence(
        "T216",
        context.at(),
        {
            "plate": Quantity(named),
            "difference_s": Quantity(difference_s, "s", limit=_DIFFERENCE_S, usual=_DIFFERENCE_S.usual),
            "other": Quantity(other),
            "velocity_residual_m_s": Quantity((together, separately), "m/s", limit=_EXPLAINS * together),
        },
    )


def _accelerations(parts: Sequence[ForceVelocity], time: FloatArray, force: FloatArray) -> FloatArray:
    """Return accelerations (n, p) m/s2 of the body by forces (k, p) N over (k,) s, in all windows."""
    return np.stack(
        [
            joined_without_trend(parts, [np.interp(part.time, time, component) / part.mass_kg for part in parts])
            for component in force.T
        ],
        axis=1,
    )


def _changes(force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far forces (k, p) have grown, and fallen, up to each sample; the two add up to the force's change."""
    change = np.diff(force, axis=0, prepend=force[:1])
    return np.cumsum(np.maximum(change, 0.0), axis=0), np.cumsum(np.minimum(change, 0.0), axis=0)


def _late_at_both_ends(late_s: FloatArray, early_s: FloatArray) -> bool:
    """Return whether the late plate lags while its force grows and while it falls, and the early one's delays agree."""
    lag_s = late_s - early_s.mean()
    return bool(lag_s.min() >= _BOTH_ENDS * lag_s.mean() > 0.0) and bool(np.ptp(early_s) <= _UNEQUAL_S)


def _fitted(terms: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float]:
    """Return the factors (k,) of terms (n, k) that explain values (n,) best, and the SD that they leave."""
    factors = np.asarray(np.linalg.lstsq(terms, wanted, rcond=None)[0], dtype=float)
    return factors, float(np.std(wanted - terms @ factors))


@check("T201", "T202", unless=NEEDS_VELOCITY, vertical_growth=_LEAST_GROWTH, least=_LEAST_RATIO, most=_MOST_RATIO)
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
            velocity_ratio=Quantity(
                ratio, "1", limit=_MOST_RATIO if ratio > 1 else _LEAST_RATIO, usual=_LEAST_RATIO.usual
            ),
        )


def _wrong(ratio: float) -> bool:
    return not _LEAST_RATIO < ratio < _MOST_RATIO


def _growing_delays(context: RecordingContext) -> Iterator[Finding]:
    """Report T201: delays that grow or shrink, tested in every window."""
    trial = context.trial
    if trial is None:
        return
    for part in context.velocities:
        beside_s = min(part.time[0] - trial.markers.time[0], trial.markers.time[-1] - part.time[-1])
        if span_s(part.time) < (_LEAST_RATE_WINDOW_S if beside_s >= NEAR_END_S else LONG_WINDOW_S):
            continue
        found = vertical_match_of(part, growing=True)
        if not found or max(match.residual for match in found) > LARGEST_RESIDUAL:
            continue
        # with another gain under one foot the body seems to be pushed ever earlier, or later, within two steps
        gains = vertical_match_of(part, plate_velocity=part.by(trial.loads.time, trial.loads.force[:, 0, 1]))
        if any(match.residual > other.residual for match, other in zip(found, gains, strict=False)):
            continue
        delay, rate_error = (
            np.array([match.delay_s for match in found]),
            np.array([match.rate_error for match in found]),
        )
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
            rate_error=Quantity(mean, "1", limit=_LEAST_GROWTH, usual=_LEAST_GROWTH.usual),
            method=Quantity("vertical velocity"),
        )


@check("T311", "T312", "T313", "T314", apart=Limit(EVENT_LIMIT_S, "s"))
def file_events(context: RecordingContext) -> Iterator[Finding]:
    """Report T311 to T314: the event of a file farthest from its forces (T311), events with sides exchanged, all of
    them (T312) or a few (T313), or times that count from the first frame (T314).
    """
    trial = context.loaded
    if not isinstance(trial, Trial):
        return
    count = sum(event.of_gait is not None for event in trial.events)
    if counted_from_first_frame(trial):
        first = Quantity(float(trial.markers.time[0]), "s")
        yield finding("T314", context.at(), events=Quantity(count, "1"), first_s=first)
        return
    if sides_exchanged(trial):
        yield finding("T312", context.at(), events=Quantity(count, "1"))
        return
    other_foot = events_of_other_foot(trial.events, [*gait_events(trial), *_by_motion(context)])
    for event in other_foot[:1]:
        yield finding(
            "T313",
            context.at(),
            event=Quantity(event.label),
            foot=Quantity(FOOT_NAMES[FEET.index(event.side)]),
            other_foot=Quantity(FOOT_NAMES[1 - FEET.index(event.side)]),
            time_s=Quantity(event.time_s, "s"),
            events=Quantity(len(other_foot), "1"),
        )
    apart = contradicted_events(trial)
    if apart:
        stated, shown = max(apart, key=lambda pair: abs(pair[0].time_s - pair[1].time_s))
        difference = stated.time_s - shown.time_s
        yield finding(
            "T311",
            context.at(),
            event=Quantity(stated.label),
            foot=Quantity(FOOT_NAMES[FEET.index(stated.side)]),
            time_s=Quantity(stated.time_s, "s"),
            difference_s=Quantity(difference, "s", limit=EVENT_LIMIT_S),
            apart_s=Quantity(abs(difference), "s"),
            direction=Quantity("after" if difference > 0.0 else "before"),
            events=Quantity(len(apart), "1"),
        )


def _by_motion(context: RecordingContext) -> Iterator[GaitEvent]:
    """Detect foot strikes and foot offs as the beginning and end of stance phases that the trial shows."""
    for side, foot in zip(FEET, context.foot_trajectories or (), strict=False):
        for start, end, _ in foot.stance_spans:
            if start > foot.time[0]:
                yield GaitEvent(start, side, "heel strike")
            if end < foot.time[-1]:
                yield GaitEvent(end, side, "toe off")


@check("T301", apart=_APART, slow=Limit(LEAST_BELT_M_S, "m/s"))
def belt_speed(context: RecordingContext) -> Iterator[Finding]:
    """Report T301: a stated belt speed that differs from the speed of feet in stance; of two feet, the larger error."""
    belt, time = context.recording.belt, context.all_markers.time
    if belt is None or context.feet is None:
        return
    speeds = standing_speeds(context.all_markers, context.feet)
    if speeds is None:
        return
    stated = [belt.under(foot).distance_m(*time[[0, -1]]) / float(np.ptp(time)) for foot in range(2)]
    pairs = list(zip(stated, speeds, strict=True))
    excess = [abs(speed - other) / max(_APART * max(speed, other), LEAST_BELT_M_S) for speed, other in pairs]
    worst = int(np.argmax(excess))
    if excess[worst] <= 1.0:
        return
    causes: tuple[str, ...] = ()
    if belt.speed_m_s.ndim == 2 and np.abs(np.subtract(stated, speeds[::-1])).max() < LEAST_BELT_M_S:
        causes = ("right and left belt interchanged",)
    elif abs(stated[worst] / max(speeds[worst], 1e-9) / _KM_H - 1) < _APART:
        causes = ("a speed in km/h",)
    split_belt = belt.speed_m_s.ndim == 2
    evidence = {
        "stated_m_s": Quantity(stated[worst], "m/s"),
        "feet_m_s": Quantity(speeds[worst], "m/s"),
        "foot": Quantity(FOOT_NAMES[worst] if split_belt else "either"),
    }
    if not split_belt:
        evidence["belt_speed_m_s"] = Quantity(speeds[worst], "m/s")
    yield with_evidence("T301", context.at(), evidence, causes=causes)
