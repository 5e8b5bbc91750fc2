"""Models how far the shoulders move in the trunk: an error that all markers of an arm share.

The models fix the shoulder centre in the trunk. A person's is attached to the clavicle, which elevates and retracts
with the arm: by 6 and 16 degrees while the arm is raised by some 110 (Ludewig et al. 2009, J Bone Joint Surg Am
91:378). Elbow and wrist bend so that the arm's markers fit to millimetres all the same, and seem that accurate. In a
drop jump with arms swung overhead, when they were taken to be, four centimetres of shoulder motion were compensated by
a trunk without any inertia about its long axis, and by a force plate displaced by 36 mm.
"""

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Joint, Skeleton
from kinertia.motion.workload import pieces

CLAVICLE_M = 0.15
CLAVICLE_PER_ARM = 0.16
"""Angle of the clavicle over that of the arm: 17 degrees over 110."""


def girdle_variance(skeleton: Skeleton, q: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the effective variance (m,) m2, along each axis, of marker positions due to the shoulder girdle.

    It is zero for markers that are not on the arms. The variance of a sum of k equal errors is k times that of k
    independent ones: the errors of an arm count as one.

    Args:
        skeleton: with its markers.
        q: (n, c) coordinates of the trial, none missing.
        shown: (m,) True for markers that the trial has.
    """
    result = np.zeros(len(skeleton.markers))
    for joint in skeleton.joints:
        if (segment_of(joint.child) or "").startswith("upper_arm") and _on_rigid_trunk(skeleton, joint):
            moved_m = CLAVICLE_M * CLAVICLE_PER_ARM * _spread_rad(skeleton, joint, q)
            carried = _from(skeleton, joint.child)
            own = shown & np.array([marker.segment in carried for marker in skeleton.markers], dtype=bool)
            result[own] = own.sum() * moved_m**2 / 3.0
    return result


def _on_rigid_trunk(skeleton: Skeleton, shoulder: Joint) -> bool:
    """Decide whether the shoulder is fixed in the trunk, with no clavicle or scapula in the model that moves it."""
    carrier = dict(zip(skeleton.segments, skeleton.tree.carrier.tolist(), strict=True))
    above = {joint.child: joint.parent for joint in skeleton.joints}
    body = shoulder.parent
    while segment_of(above[body]) == "torso":
        if carrier[body] != carrier[above[body]]:
            return segment_of(body) == "torso" and not body.lower().startswith(("clavicle", "scapula"))
        body = above[body]
    return segment_of(body) == "torso"


def _spread_rad(skeleton: Skeleton, shoulder: Joint, q: np.ndarray) -> float:
    """Return the RMS angle (rad) between the arm's direction in the trunk and its mean."""
    elbow = next((joint for joint in skeleton.joints if joint.parent == shoulder.child), None)
    far = np.array([0.0, -1.0, 0.0]) if elbow is None else elbow.translation - shoulder.child_translation
    direction = np.empty((len(q), 3))
    for some in pieces(len(q)):
        turned = skeleton.pose(q[some]).rotation
        arm, trunk = (turned[:, skeleton.segments.index(name)] for name in (shoulder.child, shoulder.parent))
        direction[some] = np.einsum("nji,njk,k->ni", trunk, arm, far / np.linalg.norm(far))
    return float(np.sqrt(np.square(direction - direction.mean(axis=0)).sum(axis=1).mean()))


def _from(skeleton: Skeleton, segment: str) -> set[str]:
    """Return the segment and all segments beyond it."""
    carried = {segment}
    for joint in skeleton.joints:
        if joint.parent in carried:
            carried.add(joint.child)
    return carried
