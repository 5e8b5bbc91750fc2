"""Which coordinates have opposite signs on the two sides, though they are one."""

from __future__ import annotations

import numpy as np

from kinertia.model.shared_coordinates import by_side
from kinertia.model.skeleton import Skeleton


def opposite_on_left(skeleton: Skeleton) -> frozenset[str]:
    """Coordinates of pelvis and trunk that turn about an axis in the plane of symmetry."""
    sideless = {name for name, columns in by_side(skeleton.coordinates).items() if "" in columns}
    axes = [axis for joint in skeleton.joints for axis in joint.axes if axis.kind == "rotation"]
    return frozenset(
        axis.coordinate for axis in axes if axis.coordinate in sideless and abs(axis.direction[2]) < np.sqrt(0.5)
    )
