"""Detects heel strikes and toe offs from the loads under the feet, and compares events stated in a file with them."""

from collections.abc import Iterable, Sequence

import numpy as np

from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, FootLoads, Trial
from kinertia.trial.file_contents import SAME_EVENT_S, FileEvent, GaitEvent, nearest_event
from kinertia.trial.ground_contact import BRIDGED_GAP_S, bridged
from kinertia.trial.plate_assignment import SHORTEST_CONTACT_S
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, runs, span_s


def gait_events(trial: Trial) -> list[GaitEvent]:
    """Return all events between measured frames, in order of time.

    Elsewhere a load may begin or end at the edge of a plate.
    """
    frames, edges = trial.markers.time, load_edges(trial.loads)
    near = [np.abs(frames - event.time_s) <= BRIDGED_GAP_S + TIME_TOLERANCE_S for event in edges]
    return [event for event, around in zip(edges, near, strict=True) if around.any() and trial.measured[around].all()]


def load_edges(loads: FootLoads) -> list[GaitEvent]:
    """Return when the load under each foot begins and ends, in order: at foot contact, or at the edge of a plate."""
    edges = []
    for foot, side in enumerate(FEET):
        loaded = bridged(loads.time, loads.force[:, foot, 1] > LOAD_THRESHOLD_N)
        for first, last in runs(loaded):
            if span_s(loads.time, first, last) < SHORTEST_CONTACT_S:
                continue
            if first > 0:
                edges.append(GaitEvent(float(loads.time[first]), side, "heel strike"))
            if last < len(loads.time) - 1:
                edges.append(GaitEvent(float(loads.time[last]), side, "toe off"))
    return sorted(edges)


EVENT_LIMIT_S = 0.03
"""Largest accepted difference: events of 14 recordings, set by Vicon or by hand, are within 17 ms of the forces."""
_PLAINLY = 2
"""Ratio of counts required: where a foot leaves the plates but not the ground, a load may end with a step of the other
foot."""
_SAME_STEP_EVENT_S = 0.1
"""Largest difference between an event and the motion or the load of the foot that makes it."""
_OTHER = dict(zip(FEET, reversed(FEET), strict=True))


def contradicted_events(trial: Trial) -> list[tuple[FileEvent, GaitEvent]]:
    """Return the stated events that are more than `EVENT_LIMIT_S` from the detected ones, in pairs."""
    shown = gait_events(trial)
    pairs = [(one, nearest_event(shown, one.of_gait, SAME_EVENT_S)) for one in trial.events if one.of_gait is not None]
    return [(one, near) for one, near in pairs if near is not None and abs(one.time_s - near.time_s) > EVENT_LIMIT_S]


def sides_exchanged(trial: Trial) -> bool:
    """Decide whether the events coincide with the loads of the other foot, and hardly any with their own."""
    edges, stated = load_edges(trial.loads), _stated(trial)
    return _agreeing(_exchanged(stated), edges) > _PLAINLY * _agreeing(stated, edges)


def counted_from_first_frame(trial: Trial) -> bool:
    """Decide whether more events coincide with loads if their times count from the first frame: two at least, and more
    than with the other foot's.
    """
    edges, stated = load_edges(trial.loads), _stated(trial)
    first_s = float(trial.markers.time[0])
    later = _agreeing([one._replace(time_s=one.time_s + first_s) for one in stated], edges)
    return later > max(1, _agreeing(stated, edges), _agreeing(_exchanged(stated), edges))


def events_of_other_foot(events: Iterable[FileEvent], shown: Sequence[GaitEvent]) -> list[FileEvent]:
    """Return the stated events that match the other foot at their times, but not their own foot."""
    wrong = []
    for one in events:
        if (stated := one.of_gait) is None:
            continue
        other = nearest_event(shown, stated._replace(side=_OTHER[stated.side]), _SAME_STEP_EVENT_S)
        if other is not None and nearest_event(shown, stated, SAME_EVENT_S) is None:
            wrong.append(one)
    return wrong


def usable_events(trial: Trial, by_motion: Sequence[GaitEvent]) -> list[GaitEvent]:
    """Return all gait events that the file states, or none if forces or the motion of the feet contradict one."""
    if contradicted_events(trial) or sides_exchanged(trial) or counted_from_first_frame(trial):
        return []
    if events_of_other_foot(trial.events, [*gait_events(trial), *by_motion]):
        return []
    return _stated(trial)


def _stated(trial: Trial) -> list[GaitEvent]:
    return [one.of_gait for one in trial.events if one.of_gait is not None]


def _exchanged(events: Sequence[GaitEvent]) -> list[GaitEvent]:
    return [one._replace(side=_OTHER[one.side]) for one in events]


def _agreeing(events: Sequence[GaitEvent], edges: Sequence[GaitEvent]) -> int:
    return sum(nearest_event(edges, event, EVENT_LIMIT_S) is not None for event in events)
