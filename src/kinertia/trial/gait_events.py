"""Detects heel strikes and toe offs from the loads under the feet, and compares events stated in a file with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, FootLoads, Trial
from kinertia.trial.gait_event import SAME_EVENT_S, FileEvent, GaitEvent, nearest_event
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


def contradicted_events(trial: Trial) -> list[tuple[FileEvent, GaitEvent]]:
    """Return the stated events that are more than `EVENT_LIMIT_S` from the detected ones, in pairs."""
    shown = gait_events(trial)
    pairs = [(one, nearest_event(shown, one.of_gait, SAME_EVENT_S)) for one in trial.events if one.of_gait is not None]
    return [(one, near) for one, near in pairs if near is not None and abs(one.time_s - near.time_s) > EVENT_LIMIT_S]


def sides_exchanged(trial: Trial) -> bool:
    """Decide whether the events coincide with the loads of the other foot and hardly with those of their own."""
    edges, stated = load_edges(trial.loads), _stated(trial)
    other = dict(zip(FEET, reversed(FEET), strict=True))
    exchanged = [one._replace(side=other[one.side]) for one in stated]
    return _agreeing(exchanged, edges) > _PLAINLY * _agreeing(stated, edges)


def usable_events(trial: Trial) -> list[GaitEvent]:
    """Return all gait events that the file states, or none if forces contradict one of them."""
    if contradicted_events(trial) or sides_exchanged(trial):
        return []
    return _stated(trial)


def _stated(trial: Trial) -> list[GaitEvent]:
    return [one.of_gait for one in trial.events if one.of_gait is not None]


def _agreeing(events: Sequence[GaitEvent], edges: Sequence[GaitEvent]) -> int:
    return sum(nearest_event(edges, event, EVENT_LIMIT_S) is not None for event in events)
