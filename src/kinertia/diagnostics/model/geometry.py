"""Are a model's lengths in metres, and its joints those of people?

A pair of joints is compared in ground axes and in the axes of the bodies that carry them, and the better of the two
counts: the axes of bodies may be chosen freely on each side, and a skewed joint further up is not the fault of this
one. Differences in position that the lengths of the two segments explain are subtracted.

All models that OpenSim users scale have the same axis, 37 degrees up from the sole and 9 degrees inward. People had 41
and 23 degrees on average (SD 9 and 11; Isman and Inman 1969), 12 degrees from it. A very different axis is more likely
a mistake, most often a lost orientation.
"""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from kinertia.diagnostics.context import PersonContext
from kinertia.diagnostics.runner import check
from kinertia.findings.finding import Finding, finding, with_evidence
from kinertia.findings.quantity import Limit, Quantity, Where
from kinertia.model.bsp import BodySegmentParameters, FloatArray
from kinertia.model.imported_model import NeutralJoints, angle_deg, mirrored, neutral_joints
from kinertia.model.skeleton import Skeleton

_AXIS_RAD = Limit(np.radians(5.0), "rad", usual=(0.0, 0.0))
"""Fault-free models: 0.0 degrees. The left subtalar joint with the right one's frames: 13.9."""
_POSITION_M = Limit(0.015, "m", usual=(0.0, 0.010))
"""Fault-free models: 0.0 mm; their segments differ in length by up to 10 mm. A talus whose offset has the other side's
sign: 18 mm."""
_FARTHEST_RAD = Limit(np.radians(25.0), "rad", usual=(0.0, 0.21))
"""Models in use: 0.0 degrees. An axis along the foot: 38."""
_USUAL = (0.7872, 0.6047, -0.1209)
"""Forward, up, to the right: of a right foot, as gait2354 and Rajagopal have it."""
_FARTHEST_M = Limit(1.5, "m")
"""Longest body from its joint: a thigh has half a metre, the end of a barbell is 1.1 m from its middle."""
_SMALLEST_M, _LARGEST_M = Limit(0.2, "m"), Limit(3.0, "m")
"""Largest distance of two joints of a whole body: a newborn's legs, and a giant's stretched arms."""
_WHOLE = 6
"""Joints from which on a model counts as a whole body."""


@check("O302", "O303", unless=("O301",), axis=_AXIS_RAD, position=_POSITION_M)
def mirrored_joints(context: PersonContext) -> Iterator[Finding]:
    """Report O302 and O303: axes (O302) and positions (O303) of joints whose left and right do not mirror each other.

    A position changes the sign of z in its mirror image, a direction or orientation those of x and y.
    """
    neutral = None if context.model is None else neutral_joints(context.model.skeleton)
    if neutral is None or neutral.sideways is None:
        return
    for pair in neutral.pairs:
        for first, second, angle in _axis_angles(neutral, pair, neutral.sideways):
            if angle > _AXIS_RAD:
                angle_rad = Quantity(angle, "rad", limit=_AXIS_RAD, usual=_AXIS_RAD.usual)
                yield _finding("O302", first, second, angle_rad=angle_rad)
    for right, left in neutral.pairs:
        distance = _mismatch_m(neutral, right, left, neutral.sideways)
        if distance > _POSITION_M:
            distance_m = Quantity(distance, "m", limit=_POSITION_M, usual=_POSITION_M.usual)
            yield _finding("O303", right, left, distance_m=distance_m)


def _finding(code: str, right: str, left: str, **measured: Quantity) -> Finding:
    evidence = {**measured, "right": Quantity(right), "left": Quantity(left)}
    return with_evidence(code, Where(part=without_side(right)), evidence)


def _axis_angles(neutral: NeutralJoints, pair: tuple[str, str], sideways: int) -> Iterator[tuple[str, str, float]]:
    """Yield coordinates of the right and left joint, and the angle (rad) of one axis from the other's mirror image."""
    right, left = pair
    others = {without_side(name): name for name in neutral.turns[left]}
    for name, axis in neutral.turns[right].items():
        other = others.get(without_side(name))
        if other is not None:
            angles = [
                angle_deg(turn.T @ axis, reflection @ back.T @ neutral.turns[left][other])
                for turn, back, reflection in _views(neutral, right, left, sideways)
            ]
            yield name, other, float(np.radians(min(angles)))


def _mismatch_m(neutral: NeutralJoints, right: str, left: str, sideways: int) -> float:
    """Return how far (m) the right joint is from the left one's mirror image, each in its own parent.

    Zero where the parents are not each other's: one knee of a model may have more bodies than the other.
    """
    parents = [neutral.joints[name].parent for name in (right, left)]
    if "ground" in parents or (parents[0] != parents[1] and tuple(parents) not in neutral.pairs):
        return 0.0
    apart = []
    for turn, back, reflection in _views(neutral, right, left, sideways):
        if parents[0] == parents[1]:
            apart.append(_in_one_parent(neutral, right, left, (turn, reflection)))
            continue
        vectors = [
            frame.T @ (neutral.centres[name] - neutral.centres[parent])
            for frame, name, parent in zip((turn, back), (right, left), parents, strict=True)
        ]
        lengths = [float(np.linalg.norm(vector)) for vector in vectors]
        if min(lengths) < 1e-6:
            return max(lengths)
        directions = vectors[0] / lengths[0] - reflection @ vectors[1] / lengths[1]
        apart.append(float(np.linalg.norm(directions)) * sum(lengths) / 2)
    return min(apart)


def _in_one_parent(neutral: NeutralJoints, right: str, left: str, view: tuple[FloatArray, FloatArray]) -> float:
    """Return the asymmetry (m) of two joints of one body about its unpaired joints, else about their own middle."""
    turn, reflection = view
    parent = neutral.joints[right].parent
    first, second = (turn.T @ (neutral.centres[name] - neutral.origins[parent]) for name in (right, left))
    across = reflection.diagonal() < 0
    middle = [
        (turn.T @ (neutral.centres[name] - neutral.origins[parent]))[across]
        for name, joint in neutral.joints.items()
        if joint.parent == parent and not name.endswith(("_r", "_l"))
    ]
    apart = first - reflection @ second
    apart[across] -= 2 * np.mean(middle) if middle else apart[across]
    return float(np.linalg.norm(apart))


def _views(
    neutral: NeutralJoints, right: str, left: str, sideways: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield viewing axes at the right and left joint and the reflection between them: ground's, then the parents'."""
    yield np.eye(3), np.eye(3), mirrored(sideways)
    first, second = (neutral.joints[name].parent for name in (right, left))
    if "ground" not in (first, second):
        turn, back = neutral.rotations[first], neutral.rotations[second]
        yield turn, back, mirrored(int(np.abs(turn[sideways]).argmax()))


def without_side(coordinate: str) -> str:
    """Return the name that both sides have in common."""
    return re.sub(r"_[rl](?=_|$)", "", coordinate)


@check("O304", unless=("O301",), axis=_FARTHEST_RAD)
def subtalar_axis(context: PersonContext) -> Iterator[Finding]:
    """Report O304: a subtalar axis far from where people have it (some 40 degrees up from the sole, 10 to 20
    inward)."""
    neutral = None if context.model is None else neutral_joints(context.model.skeleton)
    if neutral is None or neutral.sideways is None:
        return
    far = {}
    for body, axes in neutral.turns.items():
        if not body.lower().startswith("calcn") or not neutral.joints[body].parent.lower().startswith("talus"):
            continue
        if len(axes) == 1 and body.endswith(("_r", "_l")):
            ((coordinate, axis),) = axes.items()
            angle = float(np.radians(angle_deg(axis, _usual(neutral, body))))
            if angle > _FARTHEST_RAD:
                far[coordinate] = angle
    if far:
        # both sides in one: what is said of their asymmetry has the name that they share, too
        worst = max(far, key=far.__getitem__)
        angle_rad = Quantity(far[worst], "rad", limit=_FARTHEST_RAD, usual=_FARTHEST_RAD.usual)
        yield finding("O304", Where(part=without_side(worst)), angle_rad=angle_rad, joints=Quantity(", ".join(far)))


def _usual(neutral: NeutralJoints, body: str) -> np.ndarray:
    """Return the usual axis (3,) of this foot, in ground, where forward follows from up and right."""
    forward, up, right = _USUAL
    to_right = np.zeros(3)
    across = sum((neutral.centres[first] - neutral.centres[other] for first, other in neutral.pairs), np.zeros(3))
    to_right[neutral.sideways] = np.sign(across[neutral.sideways])
    ahead = np.cross([0.0, 1.0, 0.0], to_right)
    inward = right if body.endswith("_r") else -right
    return np.asarray(forward * ahead + up * np.array([0.0, 1.0, 0.0]) + inward * to_right)


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
    places = skeleton.neutral.translation[0]
    return float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
