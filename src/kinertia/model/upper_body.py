"""Computes joint centres and axes of trunk and arms of a standing person from landmarks; finds head markers.

Points are in ground axes (m), frames follow ISB: x anterior, y up or proximal, z right. Sources: cervical joint Dumas
et al. (2007); shoulder Rab et al. (2002). What the trial does not show is replaced by stature and an upright pose:
`assumptions` lists it.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.model.anatomy import segment_of
from kinertia.model.anthropometry import reference_lengths
from kinertia.model.joint_centres import MARKER_RADIUS_M, Landmarks, frame
from kinertia.model.skeleton import Skeleton

_SHOULDER_DROP = 0.17
_BIACROMIAL_OF_STATURE = 0.2
"""Distance between the skin over the acromia, 4 cm inside the shoulder width of Drillis and Contini (1966)."""
_ELBOW_WIDTH_OF_STATURE = 0.04
_CERVICAL_RAISED = {"male": np.radians(8.0), "female": np.radians(14.0)}
_CERVICAL = {"male": 0.55, "female": 0.53}
_SIGNS = {"r": 1.0, "l": -1.0}
ARM_SEGMENTS = ("upper_arm", "forearm")
_HEAD_M = 0.14
"""Height above the shoulder centres; the temples of a child of six are higher, with hanging arms."""
_TRUNK_M = 0.12
"""Height below which markers are on the trunk: C7 and the acromia are lower."""
_GAP_M = 0.08
"""Least distance between the highest marker of the trunk and the lowest of the head."""
_SHOW_A_SEGMENT = 3


class Arm(NamedTuple):
    """Elbow and wrist centres (3,) m, and the elbow's flexion axis (unit, to the right when the arm hangs)."""

    elbow: np.ndarray
    wrist: np.ndarray
    axis: np.ndarray


def torso_frame(
    marks: Landmarks, lumbar: np.ndarray, height_m: float, sex: str
) -> tuple[np.ndarray, float, dict[str, np.ndarray]]:
    """Return the torso's rotation (origin: lumbar joint), length to the cervical joint (m), and shoulder centres.

    With C7 and sternal notch the cervical joint is Dumas' (2007). Otherwise the axis points to the middle of the
    acromia and the length is Dumas' share of the stature: acromia rise by up to 10 cm with raised arms, as in a T-pose.
    Without acromia either, the torso is upright over the pelvis. A missing acromion is the mirror image of the other
    one about the torso; without both, the shoulders are placed by stature.
    """
    acromia = {side: marks[f"acromion_{side}"] for side in "rl" if f"acromion_{side}" in marks}
    both = len(acromia) == len(_SIGNS)
    across = acromia["r"] - acromia["l"] if both else marks["asis_r"] - marks["asis_l"]
    length = reference_lengths(height_m, sex)["torso"]
    if "c7" in marks and "sternal_notch" in marks:
        depth = marks["sternal_notch"] - marks["c7"]
        upward = Rotation.from_rotvec(_CERVICAL_RAISED[sex] * across / np.linalg.norm(across))
        top = marks["c7"] + _CERVICAL[sex] * upward.apply(depth)
        length = float(np.linalg.norm(top - lumbar))
    elif both:
        top = (acromia["r"] + acromia["l"]) / 2
    else:
        top = lumbar + np.array([0.0, 1.0, 0.0])
    rotation = frame(top - lumbar, across)
    width = float(np.linalg.norm(across)) if both else _BIACROMIAL_OF_STATURE * height_m
    drop = _SHOULDER_DROP * width * rotation[:, 1]
    places = _shoulders(acromia, rotation, lumbar, length, width)
    return rotation, length, {side: place - drop for side, place in places.items()}


def _shoulders(
    acromia: Mapping[str, np.ndarray], rotation: np.ndarray, lumbar: np.ndarray, length: float, width: float
) -> dict[str, np.ndarray]:
    """Return both acromia: those known, a mirror image of a single one, or the ends of a width at neck height."""
    z = rotation[:, 2]
    if len(acromia) == 1:
        ((side, known),) = acromia.items()
        image = known - 2.0 * ((known - lumbar) @ z) * z
        return {shoulder: known if shoulder == side else image for shoulder in _SIGNS}
    neck = lumbar + length * rotation[:, 1]
    return {side: acromia.get(side, neck + sign * width / 2 * z) for side, sign in _SIGNS.items()}


def arm_is_known(marks: Landmarks, side: str) -> bool:
    """Return whether an elbow or a wrist marker shows where the arm is."""
    return any(f"{name}_{side}" in marks for name in ("elbow_lateral", "elbow_medial", "wrist"))


def arm(marks: Landmarks, shoulder: np.ndarray, torso: np.ndarray, height_m: float, sex: str, side: str) -> Arm:
    """Compute the joint centres of an arm.

    The elbow's axis runs through the epicondyles if both are marked; else it is perpendicular to the plane of upper arm
    and forearm, or, with a straight elbow, the torso's z axis rotated with the arm. With one epicondyle the centre lies
    half an elbow width (measured, or 4 % of the stature) from it. An arm without a wrist marker is straight, with a
    forearm by stature; without an elbow marker, the elbow is on the line from shoulder to wrist. An arm with neither
    hangs along the torso, with de Leva's (1996) length.
    """
    lateral, medial = (marks.points.get(f"elbow_{which}_{side}") for which in ("lateral", "medial"))
    wrist = marks.points.get(f"wrist_{side}")
    lengths = reference_lengths(height_m, sex)
    if lateral is None and medial is None:
        if wrist is None:
            elbow = shoulder - lengths["upper_arm"] * torso[:, 1]
            return Arm(elbow, elbow - lengths["forearm"] * torso[:, 1], torso[:, 2])
        elbow = shoulder + (wrist - shoulder) * lengths["upper_arm"] / (lengths["upper_arm"] + lengths["forearm"])
        return Arm(elbow, wrist, _elbow_axis(shoulder, elbow, wrist, torso))
    sign = _SIGNS[side]
    if lateral is not None and medial is not None:
        across, elbow = sign * (lateral - medial), (lateral + medial) / 2
        wrist = _straight(shoulder, elbow, lengths) if wrist is None else wrist
        return Arm(elbow, wrist, across / np.linalg.norm(across))
    half = (marks.width(f"elbow_{side}") or _ELBOW_WIDTH_OF_STATURE * height_m) / 2 + MARKER_RADIUS_M
    seen, inward = (lateral, -sign * half) if lateral is not None else (medial, sign * half)
    assert seen is not None
    elbow = seen
    for _ in range(3):
        end = _straight(shoulder, elbow, lengths) if wrist is None else wrist
        axis = _elbow_axis(shoulder, elbow, end, torso)
        elbow = seen + inward * axis
    return Arm(elbow, _straight(shoulder, elbow, lengths) if wrist is None else wrist, axis)


def _straight(shoulder: np.ndarray, elbow: np.ndarray, lengths: Mapping[str, float]) -> np.ndarray:
    """Return the wrist of a forearm that continues the upper arm."""
    upper = elbow - shoulder
    result: np.ndarray = elbow + lengths["forearm"] * upper / np.linalg.norm(upper)
    return result


def _elbow_axis(shoulder: np.ndarray, elbow: np.ndarray, wrist: np.ndarray, torso: np.ndarray) -> np.ndarray:
    upper = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    lower = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    normal = np.cross(upper, lower)
    if np.linalg.norm(normal) > np.sin(np.radians(15.0)):
        axis: np.ndarray = normal / np.linalg.norm(normal)
    else:
        swing, _ = Rotation.align_vectors(upper[None], -torso[:, 1][None])
        axis = swing.apply(torso[:, 2])
    return axis


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
