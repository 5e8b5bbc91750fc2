"""Finds what a person does in a trial: walk straight, turn, run, land, squat, or something else."""

import numpy as np

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.subject.movements import movements_of
from kinertia.trial.data import BoolArray
from kinertia.trial.sampled_time import runs, span_s
from kinertia.trial.trial_input import Task

_FLIGHT_S = 0.03
"""Shortest flight of a run; contacts by markers are uncertain by about as much."""
_LANDING_S = 0.1
"""Shortest flight before a landing: walking has none."""


def task_of(context: RecordingContext) -> Task:
    """Return the task: as stated, or found from the contacts of the feet, the heading and height of the pelvis.

    Strides (`RecordingContext.has_strides`) with a flight phase and without double support are a run, others a turn
    where the pelvis turns by more than 30 degrees, else a walk. Without strides it is a landing where both feet land
    after 0.1 s in the air, and a squat where both stay on the ground while the pelvis moves up and down by 0.15 m.
    """
    if context.stated_task is not None:
        return context.stated_task
    trial = context.trial
    ground = None if trial is None or trial.on_ground is None else trial.on_ground
    if context.has_strides:
        runs_ = ground is not None and _runs(context.all_markers.time, ground)
        return "turn" if context.turns else "run" if runs_ else "walk"
    if ground is None:
        return "other"
    if _flights(context.all_markers.time, ground, _LANDING_S):
        return "landing"
    movements = movements_of(context)
    return "squat" if movements is not None and movements.squats and ground.all() else "other"


def _runs(time: np.ndarray, ground: BoolArray) -> bool:
    """Return whether the feet (n, 2) are in the air together between contacts, and never on the ground together."""
    flights = _flights(time, ground, _FLIGHT_S)
    first, last = (flights[0][0], flights[-1][1]) if flights else (0, -1)
    return bool(flights) and not ground[first : last + 1].all(axis=1).any()


def _flights(time: np.ndarray, ground: BoolArray, least_s: float) -> list[tuple[int, int]]:
    """Return first and last frame of the flights between two contacts that last so long."""
    air = runs(~np.logical_or.reduce(ground, axis=1))
    return [(a, b) for a, b in air if a > 0 and b < len(time) - 1 and span_s(time, a - 1, b + 1) > least_s]
