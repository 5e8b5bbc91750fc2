"""Computes the nine angles of clinical gait analysis, with the axes, rotations and signs of Plug-in Gait.

Signs are equal on both sides: anterior tilt, the side up, internal rotation, flexion, adduction and dorsiflexion are
positive. Angles of pelvis and foot are relative to the direction of the stride. Segments are the model's: compared with
Vicon's own angles, from markers frame by frame, curves have the same shape and constant offsets (flexion of the hip by
up to 13 degrees).
"""

from typing import NamedTuple

import numpy as np

from kinertia.model.skeleton import Skeleton
from kinertia.motion.model_outputs import plug_in_gait_angles
from kinertia.trial.data import FEET


class ClinicalAngle(NamedTuple):
    """One of the nine angles: its title, and the joint and component of the Vicon output that it equals."""

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
"""The nine angles by their quantity in `cycles.csv` and norms."""


def clinical_angles(skeleton: Skeleton, q: np.ndarray, heading_rad: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """Compute the clinical angles (n,) deg of each side ("r", "l"), by quantity; NaN where coordinates from ground to
    foot are NaN.

    None for a model without legs of hip, knee and ankle in ISB's axes.

    Args:
        skeleton: the model.
        q: (n, c) coordinates, rad and m.
        heading_rad: (n,) direction of the strides, from ground's X axis to the left.
    """
    outputs = plug_in_gait_angles(skeleton, np.where(np.isfinite(q), q, 0.0), heading_rad)
    result: dict[str, dict[str, np.ndarray]] = {side: {} for side in FEET}
    for side, name in zip(FEET, skeleton.feet, strict=True) if outputs else ():
        foot = skeleton.segments.index(name)
        known = np.isfinite(q[:, np.unique(skeleton.map.owner[skeleton.support[foot]])]).all(axis=1)
        for quantity, one in CLINICAL_ANGLES.items():
            values = outputs[f"{side.upper()}{one.joint}Angles"][:, one.component]
            result[side][quantity] = np.where(known, values, np.nan)
    return result
