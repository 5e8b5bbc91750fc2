"""Estimates how far masses depend on the task, such as what moves with the thigh in squats.

A thigh has mass that follows the pelvis when the hip is bent (buttock, hamstrings), and soft parts that follow neither.
Trials of one person agreed on the mass of a thigh within a task and not between tasks: 8.8 +- 0.7 kg walking, 6.9
jumping, 5.7 squatting, with as much more or less at the pelvis. Nothing that was tried explains it; it belongs to the
error of what one task says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.cost_term import CostTerm
from kinertia.estimation.simultaneous.given import BSP
from kinertia.model.anatomy import segment_of

TASK_SD = 0.1
"""Of the mass that moves with a thigh, share of it. Walks, jumps and squats of that person are 0.2 apart (SD); with 0.1
the deviations of thighs are those of the literature, or nearly."""


def task_direction(segments: Sequence[str], mass_kg: np.ndarray) -> np.ndarray:
    """(10 s,) one deviation of what a task shows otherwise, in the segments' unknowns, of which each first one is the
    logarithm of a mass (s,).

    What the thighs lose the pelvis gains.
    """
    of = [segment_of(name) or "" for name in segments]
    thighs, pelvis = (np.array([each.startswith(wanted) for each in of]) for wanted in ("thigh", "pelvis"))
    gained = np.where(thighs, TASK_SD * mass_kg, 0.0)
    if pelvis.any():
        gained -= np.where(pelvis, gained.sum() * mass_kg / mass_kg[pelvis].sum(), 0.0)
    moved = np.zeros(10 * len(segments))
    moved[::10] = gained / mass_kg
    return moved


class TaskMasses(CostTerm):
    """What one task shows of the masses otherwise than another would: one more unknown, left out of the vector."""

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """By which the data see the masses displaced."""
        result: np.ndarray = np.zeros(len(static))
        result[self.layout[BSP]] = task_direction(self.model.segments, self.model.bsp(static).mass_kg)
        return result
