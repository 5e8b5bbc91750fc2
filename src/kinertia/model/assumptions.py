"""Replaces landmarks that are missing in a static trial by assumptions of the built-in model."""

from collections.abc import Iterator
from dataclasses import dataclass

from kinertia.model.joint_centres import Landmarks, medial_by_the_other_side
from kinertia.model.marker_set import in_words
from kinertia.model.shared_coordinates import mirrored
from kinertia.model.upper_body import arm_is_known


@dataclass(frozen=True)
class Assumption:
    """One part of the model that is built without its landmarks.

    Attributes:
        part: of the body.
        lacking: landmarks that the trial does not show.
        instead: what replaces them, as a clause.
        of_leg: whether joint moments of the legs depend on it.
    """

    part: str
    lacking: tuple[str, ...]
    instead: str
    of_leg: bool = False


def assumptions(marks: Landmarks) -> Iterator[Assumption]:
    """Yield the assumptions of a model that can be built.

    A trunk or an arm without any marker is not an assumption, since its motion is not visible either.
    """
    yield from _pelvis(marks)
    for side in "rl":
        yield from _hinges(marks, side)
    yield from _trunk(marks)
    for side in "rl":
        yield from _arm(marks, side)


def _lacking(marks: Landmarks, *names: str) -> tuple[str, ...]:
    return tuple(name for name in names if name not in marks)


def _pelvis(marks: Landmarks) -> Iterator[Assumption]:
    lacking = _lacking(marks, "psis_r", "psis_l")
    if len(lacking) == 1 and "sacrum" not in marks:
        yield Assumption("pelvis", lacking, "it mirrors the other one")


def _hinges(marks: Landmarks, side: str) -> Iterator[Assumption]:
    for joint, wand in (("knee", "thigh_wand"), ("ankle", "shank_wand")):
        name, medial = f"{joint}_{side}", f"{joint}_medial_{side}"
        if medial in marks:
            continue
        if f"{wand}_{side}" in marks and marks.width(name) is not None:
            if name not in marks.widths:
                yield Assumption(name, (f"{name}_width",), f"that of the {in_words(mirrored(name))} is used")
        elif medial_by_the_other_side(marks, joint, side) is not None:
            yield Assumption(name, (medial,), "it mirrors the other leg's", of_leg=True)


def _trunk(marks: Landmarks) -> Iterator[Assumption]:
    torso, *arms = (
        any(label in marks.markers for label in marks.marker_set.segments.get(segment, ()))
        for segment in ("torso", "upper_arm_r", "upper_arm_l", "forearm_r", "forearm_l")
    )
    acromia = _lacking(marks, "acromion_r", "acromion_l")
    if torso and acromia and (spine := _lacking(marks, "c7", "sternal_notch")):
        yield Assumption("torso", (*acromia, *spine), "the trunk is assumed to be upright in it")
    if acromia and any(arms):
        instead = "the shoulder mirrors the other one" if len(acromia) == 1 else "shoulders are placed by stature"
        yield Assumption("shoulders", acromia, instead)


def _arm(marks: Landmarks, side: str) -> Iterator[Assumption]:
    elbow, wrist = (f"elbow_lateral_{side}", f"elbow_medial_{side}"), f"wrist_{side}"
    named = marks.marker_set.landmarks.get(wrist, ())
    seen = [label for label in named if label in marks.markers]
    part = f"arm_{side}"
    if not arm_is_known(marks, side):
        segments = marks.marker_set.segments
        worn = [*segments.get(f"upper_arm_{side}", ()), *segments.get(f"forearm_{side}", ())]
        if any(label in marks.markers for label in worn):
            yield Assumption(
                part, (elbow[0], wrist), "the arm is assumed to hang from the trunk, and its markers are not used"
            )
    elif wrist not in marks:
        yield Assumption(part, (wrist,), "the forearm is assumed to continue the upper arm")
    elif not any(name in marks for name in elbow):
        yield Assumption(part, elbow[:1], "the elbow is placed between shoulder and wrist")
    if 0 < len(seen) < len(named):
        lost = ", ".join(label for label in named if label not in seen)
        yield Assumption(f"wrist_{side}", (lost,), "the other marker is taken as the middle of the wrist")
