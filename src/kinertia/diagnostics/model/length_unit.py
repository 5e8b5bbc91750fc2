"""Are the lengths of a model in metres? Reading a model in millimetres raises no error."""

from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.person_context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding
from kinertia.findings.limit import Limit
from kinertia.findings.quantity import Quantity
from kinertia.model.bsp import BodySegmentParameters
from kinertia.model.skeleton import Skeleton

_FARTHEST_M = Limit(1.5, "m")
"""Longest body from its joint: a thigh has half a metre, the end of a barbell is 1.1 m from its middle."""
_SMALLEST_M, _LARGEST_M = Limit(0.2, "m"), Limit(3.0, "m")
"""Largest distance of two joints of a whole body: a newborn's legs, and a giant's stretched arms."""
_WHOLE = 6
"""Joints from which on a model counts as a whole body."""


@check("O301", farthest=_FARTHEST_M, smallest=_SMALLEST_M, largest=_LARGEST_M)
def length_unit(context: PersonContext) -> Iterator[Finding]:
    """Report O301: joints, centres of mass or markers that are not in metres; the finding identifies the farthest."""
    if context.model is None:
        return
    skeleton = context.model.skeleton
    lengths = _lengths(skeleton, context.model.bsp)
    extent_m = _extent_m(skeleton)
    extent = Quantity(extent_m, "m", usual=(_SMALLEST_M, _LARGEST_M))
    if wrong := sorted(((length, what) for length, what in lengths if length > _FARTHEST_M), reverse=True):
        length_m, what = wrong[0]
        farthest = Quantity(length_m, "m", limit=_FARTHEST_M)
        count = Quantity(len(wrong), "1")
        yield finding("O301", length_m=farthest, extent_m=extent, count=count, what=Quantity(what))
    elif len(skeleton.joints) >= _WHOLE and not _SMALLEST_M <= extent_m <= _LARGEST_M:
        what = "The largest distance between two joints"
        yield finding("O301", length_m=extent, extent_m=extent, what=Quantity(what))


def _lengths(skeleton: Skeleton, bsp: BodySegmentParameters) -> list[tuple[float, str]]:
    """List lengths (m) within bodies, and what each belongs to."""
    joints = _joints(skeleton)
    lengths = []
    for body, places in joints.items():
        apart = max(float(np.linalg.norm(place - places[0])) for place in places)
        lengths.append((apart, f"The distance between the joints of body {body}"))
    for body, mass, centre in zip(bsp.segments, bsp.mass_kg, bsp.com_m, strict=True):
        off = _nearest_m(centre, joints.get(body, [])) if mass > 0 else 0.0
        lengths.append((off, f"The distance between the centre of mass of body {body} and its joints"))
    for marker in skeleton.markers:
        off = _nearest_m(marker.position, joints.get(marker.segment, []))
        lengths.append((off, f"The distance of marker {marker.label} from the joints of its body {marker.segment}"))
    return lengths


def _joints(skeleton: Skeleton) -> dict[str, list[np.ndarray]]:
    """Return by body the joints (3,) m that it carries and its own, in its frame; the root's own may be anywhere."""
    joints: dict[str, list[np.ndarray]] = {}
    for joint in skeleton.joints:
        if joint.parent != "ground":
            joints.setdefault(joint.parent, []).append(np.asarray(joint.translation))
            joints.setdefault(joint.child, []).append(np.asarray(joint.child_translation))
    return joints


def _nearest_m(place: np.ndarray, joints: Sequence[np.ndarray]) -> float:
    return min((float(np.linalg.norm(place - joint)) for joint in joints), default=0.0)


def _extent_m(skeleton: Skeleton) -> float:
    """Return the largest distance (m) between two bodies' origins with all coordinates at zero."""
    places = skeleton.pose(np.zeros((1, len(skeleton.coordinates)))).translation[0]
    return float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
