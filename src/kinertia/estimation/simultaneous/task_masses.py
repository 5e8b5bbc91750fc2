"""Estimates how far masses depend on the task, such as what moves with the thigh in squats.

A thigh has mass that follows the pelvis when the hip is bent (buttock, hamstrings), and soft parts that follow neither.
Trials of one person agreed on the mass of a thigh within a task and not between tasks: 8.8 +- 0.7 kg walking, 7.5
jumping, 5.5 squatting, with as much more or less at the pelvis. Nothing that was tried explains it; it belongs to the
error of what one task says, and the more the farther that task bends the hips.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.cost_term import CostTerm
from kinertia.estimation.simultaneous.given import BSP
from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton

LEAST_TASK_SD, TASK_SD_PER_RAD = 0.1, 0.14
"""Of the mass that moves with a thigh, share of it: at least, and by how far hips are bent. Walks, jumps and squats of
that person are 0.2 apart (SD). Hips are bent by 0.4 rad in its walks, 1.7 in jumps and 1.9 in squats; a task's
deviation in proportion to that makes them agree."""
_MOST_OF_TIME = 95
"""Per cent of the frames in which hips are bent by less."""
_MOST_FRAMES = 1000
"""Looked at, evenly spaced."""


def task_sd(bent_rad: float) -> float:
    """Deviation of the mass that moves with a thigh, share of it, in a task that bends the hips so far.

    >>> round(task_sd(0.4), 3), round(task_sd(1.9), 3)
    (0.1, 0.266)
    """
    return max(LEAST_TASK_SD, TASK_SD_PER_RAD * bent_rad)


def hips_bent_rad(skeleton: Skeleton, q: np.ndarray) -> float:
    """How far a thigh is turned to the pelvis in coordinates (n, c), from where it is in the model's zero pose; 0 where
    the model has no thigh or no pelvis.
    """
    of = [segment_of(name) or "" for name in skeleton.segments]
    thighs = [k for k, each in enumerate(of) if each.startswith("thigh")]
    if not thighs or "pelvis" not in of:
        return 0.0
    rotation = skeleton.pose(np.concatenate([np.zeros((1, q.shape[1])), q])).rotation
    pelvis = rotation[:, of.index("pelvis")].transpose(0, 2, 1)
    turned = [pelvis @ rotation[:, k] for k in thighs]
    cosine = [0.5 * (np.einsum("ij,nij->n", each[0], each[1:]) - 1.0) for each in turned]
    return float(np.percentile(np.arccos(np.clip(cosine, -1.0, 1.0)), _MOST_OF_TIME))


def task_direction(segments: Sequence[str], mass_kg: np.ndarray, sd: float) -> np.ndarray:
    """(10 s,) one deviation of what a task shows otherwise, in the segments' unknowns, of which each first one is the
    logarithm of a mass (s,).

    What the thighs lose, `sd` of their mass, the pelvis gains.
    """
    of = [segment_of(name) or "" for name in segments]
    thighs, pelvis = (np.array([each.startswith(wanted) for each in of]) for wanted in ("thigh", "pelvis"))
    gained = np.where(thighs, sd * mass_kg, 0.0)
    if pelvis.any():
        gained -= np.where(pelvis, gained.sum() * mass_kg / mass_kg[pelvis].sum(), 0.0)
    moved = np.zeros(10 * len(segments))
    moved[::10] = gained / mass_kg
    return moved


def _some(frames: int) -> np.ndarray:
    """At most _MOST_FRAMES of so many."""
    return np.unique(np.linspace(0, frames - 1, min(frames, _MOST_FRAMES)).astype(int))


class TaskMasses(CostTerm):
    """What one task shows of the masses otherwise than another would: one more unknown, left out of the vector.

    Of several trials it is one, too: that of the trial that bends the hips least, which knows thighs best.
    """

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """By which the data see the masses displaced."""
        given, result = self.given, np.zeros(len(static))
        bent = [
            hips_bent_rad(given.skeleton, basis.evaluate(start, _some(len(basis.first)))[0])
            for basis, start in zip(given.bases, given.start, strict=True)
        ]
        sd = task_sd(min(bent))
        result[self.layout[BSP]] = task_direction(self.model.segments, self.model.bsp(static).mass_kg, sd)
        return result
