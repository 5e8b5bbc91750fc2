"""Pairs right and left coordinates, and lists those that both sides share, or that move the skin of a segment."""

from collections.abc import Sequence

import numpy as np

from kinertia.model.skeleton import Skeleton


def by_side(names: Sequence[str]) -> dict[str, dict[str, int]]:
    """Group names by side: name without its side -> side -> index in `names`; the side is "" for unpaired names.

    Examples:
        >>> from kinertia.model.coordinate_pairs import by_side
        >>> by_side(["pelvis_tilt", "knee_angle_r", "knee_angle_l"])
        {'pelvis_tilt': {'': 0}, 'knee_angle': {'r': 1, 'l': 2}}
    """
    columns: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        base, _, side = name.rpartition("_")
        paired = side in ("r", "l") and {f"{base}_r", f"{base}_l"} <= set(names)
        columns.setdefault(base if paired else name, {})[side if paired else ""] = column
    return columns


def mirrored(name: str) -> str:
    """Return the corresponding name of the other side; names without a side are unchanged.

    Examples:
        >>> from kinertia.model.coordinate_pairs import mirrored
        >>> mirrored("knee_r"), mirrored("c7")
        ('knee_l', 'c7')
    """
    base, _, side = name.rpartition("_")
    return f"{base}_{'l' if side == 'r' else 'r'}" if side in ("r", "l") else name


def opposite_on_left(skeleton: Skeleton) -> frozenset[str]:
    """Return the coordinates of pelvis and trunk that rotate about an axis in the plane of symmetry."""
    sideless = {name for name, columns in by_side(skeleton.coordinates).items() if "" in columns}
    axes = [axis for joint in skeleton.joints for axis in joint.axes if axis.kind == "rotation"]
    return frozenset(
        axis.coordinate for axis in axes if axis.coordinate in sideless and abs(axis.direction[2]) < np.sqrt(0.5)
    )


def skin_angles(skeleton: Skeleton, segment: str) -> list[int]:
    """Return the columns of the angles of the joints at both ends of a segment.

    A segment without markers in between (a patella, a talus) belongs to the joint. The root's angles are excluded,
    since they rotate the whole body.
    """
    ends = {marker.segment for marker in skeleton.markers} | {"ground"}
    names: set[str] = set()
    reached, left = {segment}, [segment]
    while left:
        here = left.pop()
        for joint in skeleton.joints:
            if here in (joint.child, joint.parent):
                names |= {axis.coordinate for axis in joint.axes if axis.kind == "rotation"}
                other = joint.parent if joint.child == here else joint.child
                if other not in ends | reached:
                    reached.add(other)
                    left.append(other)
    return [i for i, name in enumerate(skeleton.coordinates) if i >= 6 and name in names]
