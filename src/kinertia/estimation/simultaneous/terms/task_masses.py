"""Estimates how much masses depend on the task, such as the mass that moves with the thigh in squats.

Part of a thigh's mass follows the pelvis when the hip flexes (buttock, hamstrings), and some soft tissue follows
neither. Trials of one person agreed on the mass of a thigh within a task but not between tasks: 8.8 +- 0.7 kg walking,
7.5 jumping, 5.5 squatting, with the difference at the pelvis. Nothing that was tried explains it; it is part of the
uncertainty of an estimate from one task, the more the farther that task flexes the hips.
"""

from collections.abc import Sequence

import numpy as np

from kinertia.estimation.simultaneous.inputs import BSP
from kinertia.estimation.simultaneous.terms.cost_term import CostTerm
from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton

LEAST_TASK_SD, TASK_SD_PER_RAD = 0.1, 0.095
"""Standard deviation of the mass that moves with a thigh, as a share of it: least value, and increase with hip flexion.
Walks, jumps and squats of that person differ by 0.2 (SD). Hips are flexed by 0.4 rad in its walks, 1.7 in jumps and 1.9
in squats; with a standard deviation proportional to that, the tasks agree."""
_MOST_OF_TIME = 95
"""Percentage of the frames in which hips are flexed by less."""
_MOST_FRAMES = 1000
"""Number of frames used, evenly spaced."""


def task_sd(bent_rad: float) -> float:
    """Return the SD of the mass that moves with a thigh, as a share of it, in a task that flexes the hips this far.

    >>> round(task_sd(0.4), 3), round(task_sd(1.9), 3)
    (0.1, 0.18)
    """
    return max(LEAST_TASK_SD, TASK_SD_PER_RAD * bent_rad)


def hips_bent_rad(skeleton: Skeleton, q: np.ndarray) -> float:
    """Return how far a thigh is rotated to the pelvis in coordinates (n, c), from the model's zero pose, rad.

    It is 0 if the model has no thigh or no pelvis.
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
    """Return the change (10 s,) of the segments' unknowns with one SD of the task's effect on masses.

    The first unknown of each segment is the logarithm of its mass (s,). The pelvis gains what the thighs lose, `sd` of
    their mass.
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
    """Return at most _MOST_FRAMES evenly spaced frame indices."""
    return np.unique(np.linspace(0, frames - 1, min(frames, _MOST_FRAMES)).astype(int))


class TaskMasses(CostTerm):
    """Dependence of the masses on the task: one more unknown, left out of the vector.

    With several trials it is one, too: that of the trial that flexes the hips least, which determines thighs best.
    """

    def left_out(self, static: np.ndarray) -> np.ndarray:
        """Return the displacement of the masses as seen by the data."""
        given, result = self.given, np.zeros(len(static))
        bent = [
            hips_bent_rad(given.skeleton, basis.evaluate(start, _some(len(basis.first)), derivatives=0)[0])
            for basis, start in zip(given.bases, given.start, strict=True)
        ]
        sd = task_sd(min(bent))
        result[self.layout[BSP]] = task_direction(self.model.segments, self.model.bsp(static).mass_kg, sd)
        return result
