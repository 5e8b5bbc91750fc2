"""Combines a model's bodies into the segments of the anthropometric tables, in ISB axes.

Bodies are identified by their names (femur, tibia, ...; sides by `_r` and `_l`), segments are cut at the model's joint
centres, in its pose at zero, which is upright in the usual OpenSim models. Pelvis and torso meet at L5/S1, as in the
tables; the joint between them is centimetres higher in many models.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinertia.model.anthropometry import SEGMENTS, BodyGeometry, reference_lengths
from kinertia.model.bsp import BodySegmentParameters, FloatArray, combine
from kinertia.model.joint_centres import frame, hip_in_pelvis, lumbar_in_pelvis
from kinertia.model.skeleton import Joint, Skeleton

_WORDS = {
    "pelvis": ("pelvis", "sacrum"),
    "torso": (
        *("torso", "thorax", "trunk", "abdomen", "lumbar", "spine", "cervical", "head", "neck", "skull", "jaw"),
        *("rib", "sternum", "clavicle", "scapula", "hat"),
    ),
    "thigh": ("femur", "thigh", "patella"),
    "shank": ("tibia", "fibula", "shank"),
    "foot": ("talus", "calcn", "calcaneus", "toe", "foot", "hindfoot", "midfoot", "forefoot"),
    "upper_arm": ("humerus", "upper_arm", "upperarm"),
    "forearm": ("ulna", "radius", "forearm", "lowerarm", "hand", "wrist"),
}
"""Beginnings of the names of each segment's bodies."""
_LEAST_LENGTH_M = 0.01
"""Joints closer together than this are an error in the model: they define neither length nor direction of a segment."""


@dataclass(frozen=True, eq=False)
class ModelSegments:
    """Segments of a model, each in the frame that `literature_bsp` uses for it.

    Attributes:
        bsp: of the segments that have mass, in the order of `anthropometry.SEGMENTS`.
        bodies: names of the bodies that make up each of them.
        unknown: bodies with mass whose names belong to no segment.
        geometry: joint centres and lengths of the model; None if a joint of the trunk or the legs was not found.
    """

    bsp: BodySegmentParameters
    bodies: Mapping[str, tuple[str, ...]]
    unknown: tuple[str, ...]
    geometry: BodyGeometry | None


def segment_of(body: str) -> str | None:
    """Return the segment of the anthropometric tables that a body belongs to by its name; None if unknown."""
    name = body.lower()
    side = name[-2:] if name.endswith(("_r", "_l")) else ""
    for segment, words in _WORDS.items():
        if name.startswith(words):
            if segment in ("pelvis", "torso"):
                return segment
            return segment + side if side else None
    return None


def model_segments(
    skeleton: Skeleton, bsp: BodySegmentParameters, height_m: float = 1.7, sex: str = "male"
) -> ModelSegments:
    """Combine the bodies of a model into segments.

    Args:
        skeleton, bsp: of the model.
        height_m, sex: for lengths that the model's joints do not define (the torso's up to the neck, the foot's);
            sex also for L5/S1.
    """
    pose = skeleton.neutral
    place = {name: (pose.rotation[0, i], pose.translation[0, i]) for i, name in enumerate(skeleton.segments)}
    centres, main = _joint_centres(skeleton, place)
    if "lumbar" in centres and {"hip_r", "hip_l"} <= set(centres):
        centres["lumbar"] = _l5s1(centres["hip_r"], centres["hip_l"], _pelvis_rotation(place), sex)
    masses = dict(zip(bsp.segments, bsp.mass_kg, strict=True))
    bodies: dict[str, tuple[str, ...]] = {}
    tables = []
    for segment in SEGMENTS:
        rows = [i for i, body in enumerate(bsp.segments) if segment_of(body) == segment and body in place]
        if not rows or not bsp.mass_kg[rows].sum() > 0:
            continue
        bodies[segment] = tuple(bsp.segments[i] for i in rows if masses[bsp.segments[i]] > 0)
        turns, origins = (np.array([place[bsp.segments[i]][k] for i in rows]) for k in (0, 1))
        mass, com, inertia = combine(
            bsp.mass_kg[rows],
            origins + np.einsum("bij,bj->bi", turns, bsp.com_m[rows]),
            turns @ bsp.inertia_kgm2[rows] @ turns.transpose(0, 2, 1),
        )
        rotation, origin = _segment_frame(segment, place[main.get(segment, bodies[segment][0])], centres)
        tables.append((mass, rotation.T @ (com - origin), rotation.T @ inertia @ rotation))
    combined = BodySegmentParameters(tuple(bodies), *(np.array(column) for column in zip(*tables, strict=True)))
    unknown = tuple(body for body in bsp.segments if masses[body] > 0 and segment_of(body) is None)
    geometry = _geometry(centres, place, reference_lengths(height_m, sex))
    return ModelSegments(combined, bodies, unknown, geometry)


Place = tuple[np.ndarray, np.ndarray]


def _joint_centres(skeleton: Skeleton, place: Mapping[str, Place]) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """Return joint centres in ground, and the body that each segment begins with."""
    entrances = {"torso": "lumbar", "thigh": "hip", "shank": "knee", "foot": "ankle"}
    entrances |= {"upper_arm": "shoulder", "forearm": "elbow"}
    centres: dict[str, FloatArray] = {}
    main: dict[str, str] = {}
    for joint in skeleton.joints:
        child, parent = segment_of(joint.child), segment_of(joint.parent)
        if child is None:
            continue
        base, side = (child[:-2], child[-2:]) if child[-2:] in ("_r", "_l") else (child, "")
        if child != parent and base in entrances:
            if joint.child.lower().startswith("patella"):
                continue
            centres.setdefault(entrances[base] + side, _centre(joint, place))
            main.setdefault(child, joint.child)
        elif joint.child.lower().startswith("toe"):
            centres.setdefault("toes" + side, _centre(joint, place))
        elif joint.child.lower().startswith("hand"):
            centres.setdefault("wrist" + side, _centre(joint, place))
    return centres, main


def _pelvis_rotation(place: Mapping[str, Place]) -> FloatArray:
    return next((rotation for body, (rotation, _) in place.items() if segment_of(body) == "pelvis"), np.eye(3))


def _l5s1(hip_r: FloatArray, hip_l: FloatArray, pelvis: FloatArray, sex: str) -> FloatArray:
    """Locate L5/S1 in ground above the mid hip, as in the 27-DOF model for a pelvis with this distance between hips.

    Pelvis width and height are by Harrington et al. (2007); fore and aft by Bell et al. (1990), since Harrington's
    needs the depth of the pelvis, which a model does not contain.
    """
    at_zero, at_one = (hip_in_pelvis(width, 0.0, "harrington", "r")[2] for width in (0.0, 1.0))
    width = (float(np.linalg.norm(hip_r - hip_l)) / 2 - at_zero) / (at_one - at_zero)
    x = hip_in_pelvis(width, 0.0, "bell", "r")[0]
    y = hip_in_pelvis(width, 0.0, "harrington", "r")[1]
    rise = lumbar_in_pelvis(width, sex) - np.array([x, y, 0.0])
    return np.asarray((hip_r + hip_l) / 2 + pelvis @ rise)


def _centre(joint: Joint, place: Mapping[str, Place]) -> FloatArray:
    rotation, origin = place[joint.child]
    return np.asarray(origin + rotation @ joint.child_translation)


def _segment_frame(segment: str, body: Place, centres: Mapping[str, FloatArray]) -> Place:
    """Return rotation and origin of a segment's frame in ground: y from distal to proximal joint, z the body's own."""
    rotation, origin = body
    side = segment[-2:]
    ends = {"thigh": ("hip", "knee"), "shank": ("knee", "ankle")}
    ends |= {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}
    if segment[:-2] in ends:
        near, far = (centres.get(name + side) for name in ends[segment[:-2]])
        if near is not None and far is not None and np.linalg.norm(near - far) > _LEAST_LENGTH_M:
            rotation = frame(near - far, rotation[:, 2])
        return rotation, origin if near is None else near
    if segment[:-2] == "foot":
        return np.eye(3), centres.get("ankle" + side, origin)
    return rotation, centres.get("lumbar", origin) if segment == "torso" else origin


def _geometry(
    centres: Mapping[str, FloatArray], place: Mapping[str, Place], usual: Mapping[str, float]
) -> BodyGeometry | None:
    needed = ["lumbar", *(f"{name}_{side}" for side in "rl" for name in ("hip", "knee", "ankle"))]
    pelvis = next((body for body in place if segment_of(body) == "pelvis"), None)
    if pelvis is None or not all(name in centres for name in needed):
        return None
    rotation, origin = place[pelvis]
    lumbar = rotation.T @ (centres["lumbar"] - origin)
    mid_hip = rotation.T @ ((centres["hip_r"] + centres["hip_l"]) / 2 - origin)
    ends = {"thigh": ("hip", "knee"), "shank": ("knee", "ankle"), "foot": ("ankle", "toes")}
    ends |= {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist")}
    lengths = {"torso": usual["torso"]}
    for side in "rl":
        lengths |= {f"{name}_{side}": length for name, length in usual.items() if name != "torso"}
        for name, (near, far) in ends.items():
            if f"{near}_{side}" in centres and f"{far}_{side}" in centres:
                length = float(np.linalg.norm(centres[f"{near}_{side}"] - centres[f"{far}_{side}"]))
                if length > _LEAST_LENGTH_M:
                    lengths[f"{name}_{side}"] = length
    x, y, z = lumbar
    u, v, w = mid_hip
    return BodyGeometry((float(x), float(y), float(z)), (float(u), float(v), float(w)), lengths)
