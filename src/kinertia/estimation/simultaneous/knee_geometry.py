"""Adds the uncertainty of the knee's geometry to what it transmits by constraint.

A knee that is a hinge in the model transmits adduction and rotation moments by constraint. They depend on where its
centre is and where its axis points, which no equation of motion of the estimate can show: a centre that is displaced
sideways by 5 mm changes the adduction moment by 5 mm times the force along the shank, and an axis that points 4 degrees
too far forward takes 7 % of the flexion moment for adduction.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinertia.motion.joint_moments import JointMoments
from kinertia.motion.joint_wrench import BodyJoint

CENTRE_SD_M = 0.005
"""Standard deviation of the knee's centre to the side, chosen here."""
AXIS_SD_RAD = float(np.radians(4.0))
"""Standard deviation of its axis' direction about the shank, chosen here."""


def knee_geometry(joints: Sequence[BodyJoint], loads: np.ndarray) -> np.ndarray:
    """Return what it adds to the variances (d, 6 j) of the loads of j joints.

    Args:
        joints: the joints.
        loads: (d, 6 j) per joint its moments, then its forces, as in `MomentDerivatives`.
    """
    result = np.zeros(loads.shape)
    for k, joint in enumerate(joints):
        if joint.name == "Knee":
            flexion, forward, up = (loads[:, 6 * k + row] for row in (0, 3, 4))
            result[:, 6 * k + 1] = np.square(CENTRE_SD_M * up) + np.square(AXIS_SD_RAD * flexion)
            result[:, 6 * k + 2] = np.square(CENTRE_SD_M * forward)
    return result


def with_drawn_knees(loads: JointMoments, random: np.random.Generator) -> JointMoments:
    """Return the loads with centre and axis of each knee displaced at random, once for all frames."""
    moments = loads.moments.copy()
    for k, joint in enumerate(loads.joints):
        if joint.startswith("knee_"):
            centre_m, axis_rad = random.normal(0.0, (CENTRE_SD_M, AXIS_SD_RAD))
            moments[:, k, 1] += centre_m * loads.forces[:, k, 1] + axis_rad * loads.moments[:, k, 0]
            moments[:, k, 2] += centre_m * loads.forces[:, k, 0]
    return replace(loads, moments=moments)
