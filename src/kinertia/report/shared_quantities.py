"""Finds the quantities that two models share: names alone do not show them.

The torso of a model without arms includes the arms; the origin of a pelvis depends on its author; and a knee angle is
flexion in one model and extension in another (gait2354).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.shared_coordinates import by_side
from kinertia.model.skeleton import Skeleton
from kinertia.trial.data import FEET

_STEP_RAD = 1e-4
_ALIKE = 0.7
"""Cosine of the angle between two axes that are taken as the same; those of knees and ankles differ by 20 degrees."""


def same_segment(segment: str, one: Skeleton, other: Skeleton) -> bool:
    """Return whether in both models a segment has the same joint to the same parent, and the same segments joined to
    it.

    Items welded to it, such as a rucksack, do not matter.
    """
    return _neighbours(segment, one) == _neighbours(segment, other)


def _neighbours(segment: str, skeleton: Skeleton) -> tuple[set[tuple[str, str]], set[str]]:
    own = {
        (joint.parent, axis.coordinate) for joint in skeleton.joints if joint.child == segment for axis in joint.axes
    }
    return own, {joint.child for joint in skeleton.joints if joint.parent == segment and joint.axes}


def same_sign(name: str, side: str, one: Skeleton, other: Skeleton) -> int:
    """Return 1 where a leg's coordinate rotates the foot in the same direction in both, -1 where in opposite ones; 0
    where it rotates about another axis, or one has no such coordinate.
    """
    return sign_along(turning(name, side, one), turning(name, side, other))


def sign_along(one: np.ndarray, other: np.ndarray) -> int:
    """Return 1 for unit vectors (3,) in the same direction, -1 for opposite ones, 0 for others."""
    cosine = float(one @ other)
    return int(np.sign(cosine)) if abs(cosine) > _ALIKE else 0


def turning(name: str, side: str, skeleton: Skeleton) -> np.ndarray:
    """Return the unit vector (3,) about which the coordinate rotates the foot, all at zero; zero if it does not."""
    column = by_side(skeleton.coordinates).get(name, {}).get(side)
    if column is None:
        return np.zeros(3)
    q = np.zeros((2, len(skeleton.coordinates)))
    q[1, column] = _STEP_RAD
    before, after = skeleton.pose(q).rotation[:, skeleton.segments.index(skeleton.feet[FEET.index(side)])]
    turned = Rotation.from_matrix(after @ before.T).as_rotvec()
    length = float(np.linalg.norm(turned))
    return turned / length if length > 0.1 * _STEP_RAD else np.zeros(3)
