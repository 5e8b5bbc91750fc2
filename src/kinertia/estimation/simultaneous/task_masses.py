"""How far the masses that a task shows are from those of another: what moves with the thigh depends on the task.

A thigh has mass that follows the pelvis when the hip is bent (buttock, hamstrings), and soft parts that follow neither.
Trials of one person agreed on the mass of a thigh within a task and not between tasks: 8.8 +- 0.7 kg walking, 6.9
jumping, 5.7 squatting, with as much more or less at the pelvis. Nothing that was tried explains it; it belongs to the
error of what one task says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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


def across_tasks(
    direction: np.ndarray, data: np.ndarray, pull: float, covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What one more unknown of unit deviation changes, by which the data see the others displaced: (S,) how far the
    estimate moves back to the prior, and (S, S) how much is added to its covariance.

    Args:
        direction: (S,) by which they are displaced.
        data: (S,) information of the data on the unknowns, times this.
        pull: of the data along it, at the estimate without this unknown.
        covariance: (S, S) without it.

    >>> one = np.ones(1)
    >>> moved, added = across_tasks(one, 99.0 * one, 1.98, np.array([[0.01]]))  # 1.98 +- 0.1, prior 0 +- 1
    >>> moved.round(2), added.round(2)
    (array([-0.99]), array([[0.49]]))
    """
    carried = covariance @ data
    left = 1.0 + float(direction @ data) - float(data @ carried)
    return -carried * pull / left, np.outer(carried, carried) / left
