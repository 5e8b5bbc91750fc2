"""The nine angles of clinical gait analysis, with the axes, turns and signs of Plug-in Gait.

Signs are alike on both sides: anterior tilt, the side up, internal rotation, flexion, adduction and dorsiflexion are
positive. Pelvis and foot are against the direction of the stride. Segments are the model's: next to Vicon's own angles,
from markers frame by frame, curves have the same shape and constant offsets (flexion of the hip by up to 13 degrees).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.motion.model_outputs import plug_in_gait_angles
from kinertia.trial.data import FEET


class ClinicalAngle(NamedTuple):
    """One of the nine: its title, and which number of which of Vicon's outputs it is."""

    title: str
    joint: str
    component: int


CLINICAL_ANGLES = {
    "pelvis_tilt_clinical": ClinicalAngle("pelvic tilt", "Pelvis", 0),
    "pelvis_obliquity_clinical": ClinicalAngle("pelvic obliquity", "Pelvis", 1),
    "pelvis_rotation_clinical": ClinicalAngle("pelvic rotation", "Pelvis", 2),
    "hip_flexion_clinical": ClinicalAngle("hip flexion", "Hip", 0),
    "hip_adduction_clinical": ClinicalAngle("hip adduction", "Hip", 1),
    "hip_rotation_clinical": ClinicalAngle("hip rotation", "Hip", 2),
    "knee_flexion_clinical": ClinicalAngle("knee flexion", "Knee", 0),
    "ankle_dorsiflexion_clinical": ClinicalAngle("ankle dorsiflexion", "Ankle", 0),
    "foot_progression_clinical": ClinicalAngle("foot progression", "FootProgress", 2),
}
"""By the quantity of `cycles.csv` and of norms."""


def clinical_angles(skeleton: Skeleton, q: np.ndarray, heading_rad: np.ndarray, side: str) -> dict[str, np.ndarray]:
    """(n,) deg by quantity of a side, NaN where coordinates between ground and foot are; none without legs of hip, knee
    and ankle in ISB's axes.

    Args:
        skeleton: the model.
        q: (n, c) coordinates, rad and m.
        heading_rad: (n,) of the strides, from ground's X axis to the left.
        side: "r" or "l".
    """
    foot = skeleton.segments.index(skeleton.feet[FEET.index(side)])
    known = np.isfinite(q[:, np.unique(skeleton.map.owner[skeleton.support[foot]])]).all(axis=1)
    outputs = plug_in_gait_angles(skeleton, np.where(np.isfinite(q), q, 0.0), heading_rad)
    if not outputs:
        return {}
    angles = {
        name: outputs[f"{side.upper()}{one.joint}Angles"][:, one.component] for name, one in CLINICAL_ANGLES.items()
    }
    return {name: np.where(known, values, np.nan) for name, values in angles.items()}
