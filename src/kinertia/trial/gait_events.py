"""Finds heel strikes and toe offs from the loads under the feet."""

from __future__ import annotations

import numpy as np

from kinertia.trial.data import FEET, LOAD_THRESHOLD_N, FootLoads, Trial
from kinertia.trial.gait_event import GaitEvent
from kinertia.trial.ground_contact import bridged
from kinertia.trial.plate_assignment import BRIDGED_GAP_S, SHORTEST_CONTACT_S
from kinertia.trial.sampled_time import TIME_TOLERANCE_S, runs, span_s


def gait_events(trial: Trial) -> list[GaitEvent]:
    """All events between measured frames, in order: elsewhere a load also begins and ends with the plate."""
    frames, edges = trial.markers.time, load_edges(trial.loads)
    near = [np.abs(frames - event.time_s) <= BRIDGED_GAP_S + TIME_TOLERANCE_S for event in edges]
    return [event for event, around in zip(edges, near, strict=True) if around.any() and trial.measured[around].all()]


def load_edges(loads: FootLoads) -> list[GaitEvent]:
    """When the load under each foot begins and ends, in order: with the contact, or with the plate's edge."""
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
