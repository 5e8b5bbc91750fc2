"""What gait reports call the coordinates, and which belong to the two sides of one panel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from kinertia.model.sides import by_side
from kinertia.model.skeleton import Skeleton

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
"""Signs as in `kinertia.model.gait27`; other models may have others, so their coordinates keep their names."""


@dataclass(frozen=True)
class Coordinate:
    """One panel: its name without side, its title, and per side ("r", "l", "" where there is none) the column in q."""

    name: str
    title: str
    columns: dict[str, int]
    rotational: bool


def panels_of(skeleton: Skeleton) -> list[Coordinate]:
    """The coordinates of a skeleton in their order, left and right together."""
    sides = by_side(skeleton.coordinates)
    known = _GAIT27 if skeleton.name == "gait27" else {}
    return [
        Coordinate(
            base, known.get(base, base.replace("_", " ")), columns, bool(skeleton.rotational[min(columns.values())])
        )
        for base, columns in sides.items()
    ]


def title_of(skeleton: Skeleton, column: int) -> str:
    """One coordinate in a sentence: "hip flexion, right"."""
    for one in panels_of(skeleton):
        for side, index in one.columns.items():
            if index == column:
                words = one.title.removesuffix(" +").split(",")[0]
                return words[0].lower() + words[1:] + {"r": ", right", "l": ", left", "": ""}[side]
    raise IndexError(column)


def load_title(one: Coordinate, what: str) -> str:
    """The moment about a coordinate, with its sign: "Hip flexion +" as "Hip moment, flexion +".

    Words that a figure of three panels beside one another has no room for are left out: "Trunk bending, to the right +"
    is "Trunk moment, bending right +".
    """
    if not one.title.endswith(" +"):
        return f"{one.title} {what}"
    joint, _, direction = one.title.partition(" ")
    return f"{joint} {what}, {direction.replace(', to the', '').replace(',', '')}"


def power_title(one: Coordinate, others: Sequence[Coordinate]) -> str:
    """The power of a coordinate, whose sign is not a direction's: "Knee power, generation +".

    Of a joint that has several among `others` it says which: "Hip flexion power, generation +".
    """
    name = one.title
    if name.endswith(" +"):
        joint = name.partition(" ")[0]
        alone = sum(other.title.partition(" ")[0] == joint for other in others) == 1
        name = joint if alone else name.removesuffix(" +").split(",")[0].replace(" internal", "")
    return f"{name} power, generation +"
