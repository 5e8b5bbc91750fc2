"""R30, are the joint angles a person's? Ranges are goniometer means and three SDs of 109 men and boys (Boone and Azen
1979, J Bone Joint Surg Am 61:756); of knees and elbows that bend backwards, ten degrees, from which on joints count as
hypermobile (Beighton et al. 1973, Ann Rheum Dis 32:413), and five that a static trial with bent joints makes of them.

Hips in flexion and ankles in dorsiflexion are left out: the former hang on how the pelvis' markers tilt, the latter go
far beyond the goniometer's under a person's weight.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinertia.diagnostics.result.context import ResultContext
from kinertia.findings.finding import Finding, finding
from kinertia.findings.quantity import Quantity
from kinertia.findings.where import Where
from kinertia.model.skeleton import Skeleton

_BACKWARDS = -15.0
_DEGREES = {
    "hip_adduction": (-(45.9 + 3 * 9.3), 26.9 + 3 * 4.1),
    "hip_rotation": (-(47.2 + 3 * 6.3), 47.3 + 3 * 6.0),
    "knee_angle": (_BACKWARDS, 142.5 + 3 * 5.4),
    "ankle_angle": (-(56.2 + 3 * 6.1), np.inf),
    "subtalar_angle": (-(20.7 + 3 * 5.0), 36.8 + 3 * 4.5),
    "elbow_flex": (_BACKWARDS, 142.9 + 3 * 5.6),
}
"""Adduction, internal rotation, flexion, dorsiflexion and inversion are positive, as in OpenSim's gait models."""
_FLEXION = ("knee_angle", "elbow_flex")


def joint_angles(context: ResultContext) -> Iterator[Finding]:
    """R305 of every coordinate that leaves its range in a trial, with its most extreme angle."""
    for trial in context.fit.trials:
        names = trial.kinematics.ik.coordinates
        for column, name in enumerate(names):
            if name[-2:] not in ("_r", "_l") or name[:-2] not in _DEGREES:
                continue
            low, high = anatomical_range(trial.skeleton, name)
            angles = trial.motion.q[:, column]
            lowest, highest = float(angles.min()), float(angles.max())
            if lowest < low or highest > high:
                angle = Quantity(lowest if low - lowest > highest - high else highest, "rad")
                where = Where(trial=trial.name, part=name)
                yield finding("R305", where, angle_rad=angle, range_rad=Quantity((low, high), "rad"))


def anatomical_range(skeleton: Skeleton, coordinate: str) -> tuple[float, float]:
    """Rad; mirrored where the model counts flexion as negative, as its own range of the coordinate tells."""
    joint = coordinate[:-2]
    low, high = np.radians(_DEGREES[joint]).tolist()
    own = skeleton.ranges.get(coordinate)
    return (-high, -low) if joint in _FLEXION and own is not None and own.middle < 0.0 else (low, high)
