"""Lists the joint angles that move the skin of a segment: those of the joints at its ends."""

from kinertia.model.skeleton import Skeleton


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
