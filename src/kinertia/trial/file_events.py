"""Compares events of a file with those that forces show, and says whether they can be used."""

from __future__ import annotations

from collections.abc import Sequence

from kinertia.trial.data import FEET, Trial
from kinertia.trial.gait_event import SAME_EVENT_S, FileEvent, GaitEvent, nearest_event
from kinertia.trial.gait_events import gait_events, load_edges

EVENT_LIMIT_S = 0.03
"""Events of 14 recordings, set by Vicon or by hand, are within 17 ms of the forces."""
_PLAINLY = 2
"""Times as many: where a foot leaves the plates and not the ground, a load may end with a step of the other."""


def contradicted_events(trial: Trial) -> list[tuple[FileEvent, GaitEvent]]:
    """Events that are more than `EVENT_LIMIT_S` off what the forces show, each with that."""
    shown = gait_events(trial)
    pairs = [(one, nearest_event(shown, one.of_gait, SAME_EVENT_S)) for one in trial.events if one.of_gait is not None]
    return [(one, near) for one, near in pairs if near is not None and abs(one.time_s - near.time_s) > EVENT_LIMIT_S]


def sides_exchanged(trial: Trial) -> bool:
    """Whether events come at the times of the other foot's loads, and hardly any at those of their own."""
    edges, stated = load_edges(trial.loads), _stated(trial)
    other = dict(zip(FEET, reversed(FEET), strict=True))
    exchanged = [one._replace(side=other[one.side]) for one in stated]
    return _agreeing(exchanged, edges) > _PLAINLY * _agreeing(stated, edges)


def usable_events(trial: Trial) -> list[GaitEvent]:
    """All gait events that the file states; none where forces contradict one of them."""
    if contradicted_events(trial) or sides_exchanged(trial):
        return []
    return _stated(trial)


def _stated(trial: Trial) -> list[GaitEvent]:
    return [one.of_gait for one in trial.events if one.of_gait is not None]


def _agreeing(events: Sequence[GaitEvent], edges: Sequence[GaitEvent]) -> int:
    return sum(nearest_event(edges, event, EVENT_LIMIT_S) is not None for event in events)
