"""Finds head markers among the trunk's: the head moves independently, while the model joins both."""

from collections.abc import Collection

import numpy as np

from kinertia.model.anatomy import segment_of
from kinertia.model.skeleton import Skeleton

_HEAD_M = 0.14
"""Height above the shoulder centres; the temples of a child of six are higher, with hanging arms."""
_TRUNK_M = 0.12
"""Height below which markers are on the trunk: C7 and the acromia are lower."""
_GAP_M = 0.08
"""Least distance between the highest marker of the trunk and the lowest of the head."""
_SHOW_A_SEGMENT = 3


def head_markers(skeleton: Skeleton) -> tuple[str, ...]:
    """Return the labels of head markers: far above the shoulder centres, and separated from those below by a gap.

    None is found where shoulders are raised, nor without shoulders.
    """
    above = sorted((height, label) for label, height in _above_shoulders_m(skeleton).items())
    heights = np.array([height for height, _ in above])
    lowest = np.flatnonzero((heights > _HEAD_M) & (np.diff(heights, prepend=-np.inf) > _GAP_M))
    return tuple(label for _, label in above[lowest[0] :]) if lowest.size else ()


def without_head(skeleton: Skeleton, arms: Collection[str], worn: Collection[str]) -> tuple[Skeleton, tuple[str, ...]]:
    """Remove the head markers from the skeleton if three others show the trunk; return it with their labels.

    Args:
        skeleton: with all markers.
        arms: labels on the trunk that move with the arms, such as those of the acromia; they do not count.
        worn: labels that all trials have.
    """
    head = head_markers(skeleton)
    trunk = {label for label, height in _above_shoulders_m(skeleton).items() if height < _TRUNK_M}
    if not head or len((trunk & set(worn)) - set(arms)) < _SHOW_A_SEGMENT:
        return skeleton, ()
    return skeleton.with_markers([marker for marker in skeleton.markers if marker.label not in head]), head


def _above_shoulders_m(skeleton: Skeleton) -> dict[str, float]:
    """Return the height (m) of each trunk marker above the middle of the shoulder centres, along the trunk."""
    shoulders = [
        float(joint.translation[1])
        for joint in skeleton.joints
        if segment_of(joint.parent) == "torso" and str(segment_of(joint.child)).startswith("upper_arm")
    ]
    worn = [marker for marker in skeleton.markers if segment_of(marker.segment) == "torso"]
    return {marker.label: float(marker.position[1] - np.mean(shoulders)) for marker in worn} if shoulders else {}
