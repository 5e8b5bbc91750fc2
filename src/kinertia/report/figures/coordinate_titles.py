"""Titles coordinates as gait reports do, with the signs of each convention, and pairs those of two sides or models.

The torso of a model without arms includes the arms; the origin of a pelvis depends on its author; and a knee angle is
flexion in one model and extension in another (gait2354).

Files are not affected: names in tables state the positive direction themselves (`knee_flexion_joint_moment`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from kinertia.estimation.changes.change import named_outcome
from kinertia.estimation.result.fit import Fit
from kinertia.model.skeleton import Skeleton
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.settings import SignConvention
from kinertia.trial.data import FEET

_GAIT27 = {
    "pelvis_tx": "Pelvis forward",
    "pelvis_ty": "Pelvis upward",
    "pelvis_tz": "Pelvis to the right",
    "pelvis_tilt": "Pelvis tilt, backward +",
    "pelvis_list": "Pelvis list, right side down +",
    "pelvis_rotation": "Pelvis rotation, to the left +",
    "hip_flexion": "Hip flexion +",
    "hip_adduction": "Hip adduction +",
    "hip_rotation": "Hip internal rotation +",
    "knee_angle": "Knee flexion +",
    "ankle_angle": "Ankle dorsiflexion +",
    "subtalar_angle": "Subtalar inversion +",
    "lumbar_extension": "Trunk extension +",
    "lumbar_bending": "Trunk bending, to the right +",
    "lumbar_rotation": "Trunk rotation, to the left +",
    "arm_flex": "Shoulder flexion +",
    "arm_add": "Shoulder adduction +",
    "elbow_flex": "Elbow flexion +",
}
"""Signs as in `kinertia.model.gait27`; other models may have others."""
_COMPONENTS = {
    "ankle_flexion": "dorsiflexion",
    "ankle_adduction": "inversion",
    "lumbar_bending": "bending right",
    "lumbar_rotation": "rotation left",
}
"""Directions of three-dimensional moments that have names of their own."""
_MIRRORED = np.array([-1.0, -1.0, 1.0])
_OF_LEGS = {
    "hip_flexion": ((0.0, 0.0, 1.0), "Hip extension +"),
    "hip_adduction": ((1.0, 0.0, 0.0), "Hip abduction +"),
    "hip_rotation": ((0.0, 1.0, 0.0), "Hip external rotation +"),
    "knee_angle": ((0.0, 0.0, -1.0), "Knee extension +"),
    "ankle_angle": ((-0.1, -0.17, 0.98), "Ankle plantarflexion +"),
    "subtalar_angle": ((0.79, 0.6, -0.12), "Subtalar eversion +"),
}
"""About what the right foot turns in the directions of `_GAIT27`, and what the opposite ones are called."""
_STEP_RAD = 1e-4
_ALIKE = 0.7
"""Cosine of the angle between two axes that are taken as the same; those of knees and ankles differ by 20 degrees."""
_CLINICAL = dict(
    zip(
        CLINICAL_ANGLES,
        (
            "Pelvic tilt, anterior +",
            "Pelvic obliquity, this side up +",
            "Pelvic rotation, this side forward +",
            "Hip flexion +",
            "Hip adduction +",
            "Hip internal rotation +",
            "Knee flexion +",
            "Ankle dorsiflexion +",
            "Foot progression, toes inward +",
        ),
        strict=True,
    )
)
_OF_ISB = {
    "pelvis_tilt_clinical": "Pelvic tilt, posterior +",
    "pelvis_obliquity_clinical": "Pelvic obliquity, this side down +",
}
"""Angles whose signs are opposite by ISB (`model_outputs`)."""
_OPPOSITE = {
    "flexion": "extension",
    "adduction": "abduction",
    "internal rotation": "external rotation",
    "dorsiflexion": "plantarflexion",
    "inversion": "eversion",
}
_COORDINATES = {
    "hip_flexion": "hip_flexion",
    "hip_adduction": "hip_adduction",
    "hip_rotation": "hip_rotation",
    "knee_flexion": "knee_angle",
    "ankle_flexion": "ankle_angle",
}
"""Coordinates of OpenSim's models that turn about the axes of joint moments."""
_PELVIS = {
    "pelvis_tilt": ("pelvis_tilt_clinical", {"r": -1.0, "l": -1.0}),
    "pelvis_list": ("pelvis_obliquity_clinical", {"r": -1.0, "l": 1.0}),
    "pelvis_rotation": ("pelvis_rotation_clinical", {"r": 1.0, "l": -1.0}),
}
"""Clinical angle of each coordinate of the pelvis, and its sign by side."""
_ADDUCTION = "external knee adduction"
"""The one moment that clinics know by its external direction."""
_MOMENTS = tuple(
    f"{joint}_{name}" for joint in ("hip", "knee", "ankle") for name in ("flexion", "adduction", "rotation")
)
_TRUNK_MOMENTS = ("lumbar_flexion", "lumbar_bending", "lumbar_rotation")
OutcomeSigns = Mapping[tuple[str, str, str, str], tuple[str, float]]
"""Positive direction in words, and sign, of what is compared, by quantity, joint, component and side."""
Signs = Mapping[str, float]
"""Sign by quantity with which a curve is drawn; 1 for those that are not among them."""


@dataclass(frozen=True)
class Coordinate:
    """One panel: its name without side, its title, and per side ("r", "l", "" where there is none) the column in q."""

    name: str
    title: str
    columns: dict[str, int]
    rotational: bool


def panels_of(skeleton: Skeleton) -> list[Coordinate]:
    """List the coordinates of a skeleton in order, left and right together.

    Leg coordinates of an OpenSim model are titled by their movement, for either sign, others by their names.
    """
    sides = skeleton.sides
    ours = skeleton.name == "gait27"
    return [
        Coordinate(
            base,
            _GAIT27.get(base, _plain(base)) if ours else _imported_title(base, sorted(columns), skeleton),
            columns,
            bool(skeleton.rotational[min(columns.values())]),
        )
        for base, columns in sides.items()
    ]


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _imported_title(name: str, sides: Sequence[str], skeleton: Skeleton) -> str:
    if name not in _OF_LEGS or not set(sides) <= set(FEET):
        return _plain(name)
    axis, opposite = _OF_LEGS[name]
    right = np.array(axis)
    along = {"r": right, "l": _MIRRORED * right}
    signs = {sign_along(turning(name, side, skeleton), along[side]) for side in sides}
    named = {1: _GAIT27[name], -1: opposite}
    return named.get(signs.pop(), _plain(name)) if len(signs) == 1 else _plain(name)


def title_of(skeleton: Skeleton, column: int) -> str:
    """Title one coordinate: "hip flexion, right"."""
    for coordinate in panels_of(skeleton):
        for side, index in coordinate.columns.items():
            if index == column:
                words = coordinate.title.removesuffix(" +").split(",")[0]
                return words[0].lower() + words[1:] + {"r": ", right", "l": ", left", "": ""}[side]
    raise IndexError(column)


def load_title(coordinate: Coordinate, what: str) -> str:
    """Title the moment about a coordinate with its sign: "Hip flexion +" as "Hip moment, flexion +".

    Words for which a figure with three panels side by side has no room are left out: "Trunk bending, to the right +" is
    "Trunk moment, bending right +".
    """
    if not coordinate.title.endswith(" +"):
        return f"{coordinate.title} {what}"
    joint, _, direction = coordinate.title.partition(" ")
    return f"{joint} {what}, {direction.replace(', to the', '').replace(',', '')}"


def joint_moment_words(name: str) -> tuple[str, str]:
    """Return the joint and the positive direction of a three-dimensional joint moment, as its name has it.

    >>> joint_moment_words("knee_rotation"), joint_moment_words("lumbar_bending")
    (('Knee', 'internal rotation'), ('Trunk', 'bending right'))
    """
    joint, component = name.split("_")
    words = _COMPONENTS.get(name, {"rotation": "internal rotation"}.get(component, component))
    return "Trunk" if joint == "lumbar" else joint.capitalize(), words


def power_title(coordinate: Coordinate, others: Sequence[Coordinate]) -> str:
    """Title the power of a coordinate, whose sign is not a direction's: "Knee power, generation +".

    If the joint has several coordinates among `others`, the title includes which: "Hip flexion power, generation +".
    """
    name = coordinate.title
    if name.endswith(" +"):
        joint = name.partition(" ")[0]
        alone = sum(other.title.partition(" ")[0] == joint for other in others) == 1
        name = joint if alone else name.removesuffix(" +").split(",")[0].replace(" internal", "")
    return f"{name} power, generation +"


def same_segment(segment: str, skeleton: Skeleton, other: Skeleton) -> bool:
    """Return whether in both models a segment has the same joint to the same parent, and the same segments joined to
    it.

    Items welded to it, such as a rucksack, do not matter.
    """
    return _neighbours(segment, skeleton) == _neighbours(segment, other)


def _neighbours(segment: str, skeleton: Skeleton) -> tuple[set[tuple[str, str]], set[str]]:
    joints_above = {
        (joint.parent, axis.coordinate) for joint in skeleton.joints if joint.child == segment for axis in joint.axes
    }
    return joints_above, {joint.child for joint in skeleton.joints if joint.parent == segment and joint.axes}


def same_sign(name: str, side: str, skeleton: Skeleton, other: Skeleton) -> int:
    """Return 1 where a leg's coordinate rotates the foot in the same direction in both, -1 where in opposite ones; 0
    where it rotates about another axis, or one has no such coordinate.
    """
    return sign_along(turning(name, side, skeleton), turning(name, side, other))


def sign_along(axis: np.ndarray, other: np.ndarray) -> int:
    """Return 1 for unit vectors (3,) in the same direction, -1 for opposite ones, 0 for others."""
    cosine = float(axis @ other)
    return int(np.sign(cosine)) if abs(cosine) > _ALIKE else 0


def turning(name: str, side: str, skeleton: Skeleton) -> np.ndarray:
    """Return the unit vector (3,) about which the coordinate rotates the foot, all at zero; zero if it does not."""
    column = skeleton.sides.get(name, {}).get(side)
    if column is None:
        return np.zeros(3)
    q = np.zeros((2, len(skeleton.coordinates)))
    q[1, column] = _STEP_RAD
    before, after = skeleton.pose(q).rotation[:, skeleton.segments.index(skeleton.feet[FEET.index(side)])]
    turned = Rotation.from_matrix(after @ before.T).as_rotvec()
    length = float(np.linalg.norm(turned))
    return turned / length if length > 0.1 * _STEP_RAD else np.zeros(3)


def convention_of(fit: Fit) -> SignConvention:
    """Return the convention that is stated; by default an OpenSim model's own signs, those of clinics otherwise."""
    return fit.settings.convention or ("clinical" if fit.file is None else "opensim")


def signed_angles(convention: SignConvention) -> dict[str, tuple[str, float]]:
    """Return title and sign of the nine clinical angles by quantity."""
    flipped = _OF_ISB if convention == "isb" else {}
    return {name: (flipped.get(name, title), -1.0 if name in flipped else 1.0) for name, title in _CLINICAL.items()}


def signed_joint_moment(name: str, skeleton: Skeleton, convention: SignConvention) -> tuple[str, float]:
    """Return title and sign of a three-dimensional joint moment, which is internal; the trunk's has one sign only.

    By clinical convention extension, abduction, external rotation, plantarflexion and eversion are positive, as in
    Plug-in Gait: the external moment of the opposite direction has the same sign.
    """
    joint, words = joint_moment_words(name)
    opposite = _OPPOSITE.get(words, "") if joint != "Trunk" else ""
    turned = convention == "clinical" or (convention == "opensim" and _is_turned(name, opposite, skeleton))
    return (f"{joint} {opposite} +", -1.0) if opposite and turned else (f"{joint} {words} +", 1.0)


def _is_turned(name: str, opposite: str, skeleton: Skeleton) -> bool:
    """Return whether the coordinate about the moment's axis is positive in the opposite direction."""
    titles = {coordinate.name: coordinate.title for coordinate in panels_of(skeleton)}
    return bool(opposite) and f" {opposite} +" in titles.get(_COORDINATES.get(name, ""), "")


def outcome_signs(fit: Fit) -> OutcomeSigns:
    """Return words and signs of what is compared, by the fit's convention; files have the library's signs."""
    convention, ours = convention_of(fit), fit.skeleton.name == "gait27"
    result: dict[tuple[str, str, str, str], tuple[str, float]] = {}
    for side in (*FEET, ""):
        for name in (*_MOMENTS, *_TRUNK_MOMENTS):
            title, sign = signed_joint_moment(name, fit.skeleton, convention)
            turned = name == "knee_adduction" and sign < 0.0
            result[(*named_outcome(f"moment {name}"), side)] = _ADDUCTION if turned else _direction(title), sign
        for coordinate in panels_of(fit.skeleton):
            shown = _direction(coordinate.title) if coordinate.title.endswith(" +") else "", 1.0
            if ours and side and convention != "opensim" and coordinate.name in _PELVIS:
                quantity, signs = _PELVIS[coordinate.name]
                title, sign = signed_angles(convention)[quantity]
                shown = _direction(title), sign * signs[side]
            result[(*named_outcome(f"angle {coordinate.name}"), side)] = shown
    return result


def signed_load_title(coordinate: Coordinate, what: str, convention: SignConvention) -> tuple[str, float]:
    """Return title and sign of the moment about a leg's coordinate by a convention; OpenSim's is the model's own."""
    title = load_title(coordinate, what)
    head, comma, direction = title.removesuffix(" +").partition(", ")
    other = {"clinical": _OPPOSITE, "isb": {word: key for key, word in _OPPOSITE.items()}}.get(convention, {})
    return (f"{head}{comma}{other[direction]} +", -1.0) if direction in other else (title, 1.0)


def _direction(title: str) -> str:
    words = title.removesuffix(" +")
    return words[0].lower() + words[1:]
