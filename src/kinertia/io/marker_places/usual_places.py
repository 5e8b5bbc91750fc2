"""Tabulates marker positions of standing people, as shares of the stature: forward, up, outward (x, y, z).

Means and SDs were set by hand from published standing trials of adults and children, with allowance for posture.
"""

from dataclasses import dataclass

import numpy as np

from kinertia.trial.data import FloatArray

FOUND = 3.0
"""Score of finding a landmark, in units of half a chi square: without help of its label it is 2.4 SD off at most."""
_NAMED, _NAMED_OTHERWISE = 4.0, -3.0
"""Score of a label that means the landmark, or something else."""


@dataclass(frozen=True)
class Usual:
    """Usual position of a marker relative to another one, or to the middle of the body on the floor.

    Attributes:
        mean, sd: (x, y, z) as shares of the stature.
    """

    mean: tuple[float, float, float]
    sd: tuple[float, float, float]

    def score(self, offsets: FloatArray, stature_m: float) -> FloatArray:
        """Return scores of offsets (..., 3) m: above zero where they are near."""
        off = (offsets / stature_m - np.array(self.mean)) / np.array(self.sd)
        result: FloatArray = FOUND - 0.5 * np.square(off).sum(axis=-1)
        return result


WHERE = {
    "asis": "front corner of the pelvis",
    "psis": "back corner of the pelvis",
    "sacrum": "middle of the pelvis' back",
    "knee_lateral": "outermost at the knee",
    "knee_medial": "inside of it at the same height",
    "thigh_wand": "outermost on the thigh",
    "ankle_lateral": "outermost at the ankle",
    "ankle_medial": "inside of it at the same height",
    "shank_wand": "outermost on the shank",
    "heel": "back end of the foot",
    "metatarsal": "front of the foot",
    "toe": "tip of the foot",
    "acromion": "on top of the shoulder",
    "elbow_lateral": "an upper arm's length below the shoulder",
    "elbow_medial": "across the elbow from it",
    "wrist": "a forearm's length below the elbow",
    "c7": "on the midline behind the shoulders",
    "sternal_notch": "on the midline before the shoulders",
}
"""Descriptions of the landmarks."""
FREE = 1e3
"""SD that leaves a coordinate open."""
ASIS = Usual((0.0, 0.56, 0.0), (FREE, 0.02, FREE))
ASIS_APART = Usual((0.0, 0.0, 0.140), (0.04, 0.015, 0.022))
PSIS_FROM_ASIS = Usual((-0.105, 0.015, 0.028), (0.022, 0.018, 0.012))
SACRUM_FROM_ASIS = Usual((-0.115, 0.008, 0.0), (0.022, 0.022, 0.012))
"""The right ASIS from the left; the others in axes of the pelvis, from the middle of both ASIS."""
KNEE_FROM_ASIS = Usual((-0.065, -0.273, 0.030), (0.03, 0.02, 0.022))
ANKLE_FROM_KNEE = Usual((-0.025, -0.236, -0.003), (0.03, 0.02, 0.025))
INNER_KNEE = Usual((0.0, -0.003, -0.070), (0.018, 0.014, 0.02))
INNER_ANKLE = Usual((0.008, 0.003, -0.050), (0.013, 0.009, 0.01))
FOOT = {
    "heel": Usual((-0.035, -0.025, -0.026), (0.013, 0.013, 0.015)),
    "metatarsal_inner": Usual((0.090, -0.020, -0.045), (0.02, 0.013, 0.015)),
    "metatarsal_outer": Usual((0.068, -0.022, 0.012), (0.02, 0.013, 0.015)),
    "metatarsal_middle": Usual((0.085, -0.018, -0.018), (0.02, 0.013, 0.015)),
    "toe": Usual((0.118, -0.025, -0.022), (0.017, 0.013, 0.017)),
}
"""Positions from the lateral ankle, along the foot."""
ACROMION_FROM_ASIS = Usual((-0.06, 0.26, 0.035), (0.05, 0.03, 0.022))
C7_FROM_ACROMIA = Usual((-0.04, 0.025, 0.0), (0.03, 0.025, 0.012))
NOTCH_FROM_ACROMIA = Usual((0.04, -0.015, 0.0), (0.03, 0.025, 0.008))
ELBOW_FROM_ACROMION = (0.175, 0.025)
WRIST_FROM_ELBOW = (0.145, 0.02)
INNER_ELBOW = (0.055, 0.015)
"""Distances, mean and SD; arms may be anywhere."""


def by_label(meant: frozenset[str], landmark: str) -> float:
    """Return the score of a label, with these roles that it hints at, for a landmark."""
    if not meant:
        return 0.0
    return _NAMED if landmark in meant else _NAMED_OTHERWISE


def by_distance(distance_m: FloatArray, usual: tuple[float, float], stature_m: float) -> FloatArray:
    """Return the score of markers by their distance (m) alone."""
    return FOUND - 0.5 * np.square((distance_m / stature_m - usual[0]) / usual[1])
