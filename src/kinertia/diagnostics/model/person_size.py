"""Are the lengths of a model those of a person in metres? A model in millimetres reads without an error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

FARTHEST_M = 1.5
"""From a joint to what its body carries: a thigh has half a metre, the end of a barbell is 1.1 m from its middle."""
SMALLEST_M, LARGEST_M = 0.2, 3.0
"""Largest distance of two joints of a whole body: a newborn's legs, and a giant's stretched arms."""
_WHOLE = 6
"""Joints from which on a model counts as a whole body."""


def size_trouble(skeleton: Skeleton, bsp: BodySegmentParameters) -> str:
    """What shows that joints, mass centres or markers are not in metres; it names the farthest. Empty if nothing does.

    Args:
        skeleton, bsp: of the model.
    """
    lengths = _lengths(skeleton, bsp)
    wrong = sorted(((length, what) for length, what in lengths if length > FARTHEST_M), reverse=True)
    if wrong:
        others = f"; {len(wrong) - 1} more lengths are beyond that" if len(wrong) > 1 else ""
        length, what = wrong[0]
        return (
            f"{what} is {length:.3g} m; expected metres, at most {FARTHEST_M:g} m on a person{others}; most likely mm "
            f"or cm in place of m: divide them by 1000 or 100, or scale the model anew"
        )
    extent = _extent_m(skeleton)
    if len(skeleton.joints) < _WHOLE or SMALLEST_M <= extent <= LARGEST_M:
        return ""
    return (
        f"the joints of the model are at most {extent:.3g} m apart; expected metres, {SMALLEST_M:g} to {LARGEST_M:g} m "
        f"on a person; most likely it was scaled with lengths in another unit: scale it anew"
    )


def _lengths(skeleton: Skeleton, bsp: BodySegmentParameters) -> list[tuple[float, str]]:
    """Lengths (m) within bodies, and what each is of."""
    joints = _joints(skeleton)
    lengths = []
    for body, places in joints.items():
        apart = max(float(np.linalg.norm(place - places[0])) for place in places)
        lengths.append((apart, f"the distance of the joints of body '{body}'"))
    for body, mass, centre in zip(bsp.segments, bsp.mass_kg, bsp.com_m, strict=True):
        off = _nearest_m(centre, joints.get(body, [])) if mass > 0 else 0.0
        lengths.append((off, f"the distance of the mass centre of body '{body}' from its joints"))
    for marker in skeleton.markers:
        off = _nearest_m(marker.position, joints.get(marker.segment, []))
        lengths.append((off, f"the distance of marker '{marker.label}' from the joints of its body '{marker.segment}'"))
    return lengths


def _joints(skeleton: Skeleton) -> dict[str, list[np.ndarray]]:
    """(3,) m by body, the joints that it carries and its own, in its frame; the root's own may be anywhere."""
    joints: dict[str, list[np.ndarray]] = {}
    for joint in skeleton.joints:
        if joint.parent != "ground":
            joints.setdefault(joint.parent, []).append(np.asarray(joint.translation))
            joints.setdefault(joint.child, []).append(np.asarray(joint.child_translation))
    return joints


def _nearest_m(place: np.ndarray, joints: Sequence[np.ndarray]) -> float:
    return min((float(np.linalg.norm(place - joint)) for joint in joints), default=0.0)


def _extent_m(skeleton: Skeleton) -> float:
    """Largest distance of two bodies' origins with all coordinates at zero."""
    places = skeleton.pose(np.zeros((1, len(skeleton.coordinates)))).translation[0]
    return float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
