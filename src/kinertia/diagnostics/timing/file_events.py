"""Do the events of a file coincide with the forces?"""

from collections.abc import Iterator

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.trial.data import FEET, Trial
from kinertia.trial.file_contents import GaitEvent
from kinertia.trial.plate_assignment import FOOT_NAMES
from kinertia.trial.stances import (
    EVENT_LIMIT_S,
    contradicted_events,
    counted_from_first_frame,
    events_of_other_foot,
    gait_events,
    sides_exchanged,
)


@check("T311", "T312", "T313", "T314", apart=Limit(EVENT_LIMIT_S, "s"))
def file_events(context: RecordingContext) -> Iterator[Finding]:
    """Report T311 to T314: the event of a file farthest from its forces (T311), events with sides exchanged, all of
    them (T312) or a few (T313), or times that count from the first frame (T314).
    """
    trial = context.loaded
    if not isinstance(trial, Trial):
        return
    count = sum(one.of_gait is not None for one in trial.events)
    if counted_from_first_frame(trial):
        first = Quantity(float(trial.markers.time[0]), "s")
        yield finding("T314", context.at(), events=Quantity(count, "1"), first_s=first)
        return
    if sides_exchanged(trial):
        yield finding("T312", context.at(), events=Quantity(count, "1"))
        return
    other_foot = events_of_other_foot(trial.events, [*gait_events(trial), *_by_motion(context)])
    for one in other_foot[:1]:
        yield finding(
            "T313",
            context.at(),
            event=Quantity(one.label),
            foot=Quantity(FOOT_NAMES[FEET.index(one.side)]),
            other_foot=Quantity(FOOT_NAMES[1 - FEET.index(one.side)]),
            time_s=Quantity(one.time_s, "s"),
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
