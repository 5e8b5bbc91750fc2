"""Judges the legs that a static trial gives, replaces landmarks that it lacks, and reads a knee alignment device.

Limits are wider than what 22 static trials of 16 laboratories show, among them children who stand with feet turned out.

The device is clamped to the knee in place of the lateral knee marker. Its three markers, `LKAX` on the axis of flexion,
`LKD1` and `LKD2`, are at the ends of stalks of equal length, perpendicular to each other, whose corner is the place of
the marker (Vicon, Plug-in Gait Reference Guide). Within 2 mm that holds in the static trials of three laboratories.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model import joint_centres as jc
from kinertia.model.joint_centres import Landmarks, medial_by_the_other_side
from kinertia.model.marker_set import MarkerSet, in_words
from kinertia.model.skeleton import mirrored
from kinertia.model.upper_body import arm_is_known
from kinertia.trial.data import FloatArray, Markers, Recording

_DEGREE = float(np.pi / 180.0)
_DEVICE = re.compile(r"(?P<before>.*?)(?P<side>[lr])k(?P<part>ax|d1|d2)", re.IGNORECASE)
_UNEQUAL = 0.1
"""Difference of the distances between its markers, over their mean, up to which three markers are a device's."""
_AXIS, _KNEE, _MALLEOLUS = "AX", "NE", "MED"


@dataclass(frozen=True)
class LegLimit:
    """A quantity of a leg, with the limits of one side and of the difference between both.

    Attributes:
        name: what it is, in words.
        centre, within: of one side; rad, or the length over the other side's.
        apart: largest difference between the sides.
        usual: largest distance from the centre that was found.
    """

    name: str
    centre: float
    within: float
    apart: float
    usual: float


KNEE = LegLimit("knee axis", 0.0, 35.0 * _DEGREE, 35.0 * _DEGREE, 28.0 * _DEGREE)
ANKLE = LegLimit("ankle axis", 6.0 * _DEGREE, 40.0 * _DEGREE, 35.0 * _DEGREE, 37.0 * _DEGREE)
FOOT = LegLimit("line from heel to toes", 8.0 * _DEGREE, 45.0 * _DEGREE, 45.0 * _DEGREE, 27.0 * _DEGREE)


@dataclass(frozen=True)
class Departure:
    """What a leg has that people do not.

    Attributes:
        part: the joint or the foot, "knee_r"; of both sides "knee".
        angle_rad: rotation outwards of one side from its reference, or the difference between the sides.
        between_sides: whether it is that difference.
        limit: what was exceeded.
    """

    part: str
    angle_rad: float
    between_sides: bool
    limit: LegLimit

    @property
    def how(self) -> str:
        """Say in which sense it departs."""
        if self.between_sides:
            return "different on the two sides"
        return "rotated outwards" if self.angle_rad > 0 else "rotated inwards"

    @property
    def sentence(self) -> str:
        """Say it in a few words, in degrees."""
        where = "" if self.between_sides else f"{in_words(self.part)}: "
        return f"{where}{self.limit.name} {self.how} by {abs(np.degrees(self.angle_rad)):.0f} degrees"


def departures(marks: jc.Landmarks) -> Iterator[Departure]:
    """Yield what is implausible in the legs of a static trial: rotations of knee axes from the line of the ASIS, of
    ankle axes from the perpendicular to the foot, and of feet from the pelvis' heading.

    Raises:
        MarkerSetError: a landmark is missing.
    """
    for joint, (limit, rotation_rad) in _rotations(marks).items():
        apart = rotation_rad["r"] - rotation_rad["l"]
        far = [side for side in "rl" if abs(rotation_rad[side] - limit.centre) > limit.within]
        for side in far:
            yield Departure(f"{joint}_{side}", rotation_rad[side], False, limit)
        if not far and abs(apart) > limit.apart:
            yield Departure(joint, apart, True, limit)


def _rotations(marks: jc.Landmarks) -> dict[str, tuple[LegLimit, dict[str, float]]]:
    """Return the rotations (rad) outwards of knee, ankle and foot by side; NaN where landmarks define no axes."""
    found: dict[str, tuple[LegLimit, dict[str, float]]] = {"knee": (KNEE, {}), "ankle": (ANKLE, {}), "foot": (FOOT, {})}
    with np.errstate(invalid="ignore", divide="ignore"):
        pelvis, origin, width, depth = jc.pelvis_frame(marks)
        upright = jc.frame(np.array([0.0, 1.0, 0.0]), pelvis[:, 2])
        for side in "rl":
            leg = jc.leg_frames(marks, origin + pelvis @ jc.hip_in_pelvis(width, depth, "bell", side), side)
            axes = ((leg.knee_axis, upright), (leg.ankle_axis, leg.foot), (leg.foot[:, 2], upright))
            for (_, rotation_rad), (axis, reference) in zip(found.values(), axes, strict=True):
                rotation_rad[side] = jc.rotation_outwards(axis, reference, side)
    return found


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


def device_labels(labels: Iterable[str]) -> tuple[str, ...]:
    """Return the labels of a device's markers, which are on no segment.

    >>> device_labels(["LKAX", "LKD1", "LKD2", "RKAX", "LKNE"])
    ('LKAX', 'LKD1', 'LKD2', 'RKAX')
    """
    return tuple(label for label in labels if _DEVICE.fullmatch(label))


def _devices(labels: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return the device's labels (axis first) by what comes before KAX: "L", or "subject_L"."""
    found: dict[str, dict[str, str]] = {}
    for label in labels:
        if match := _DEVICE.fullmatch(label):
            found.setdefault(match["before"] + match["side"], {})[match["part"].upper()] = label
    return {side: (parts[_AXIS], parts["D1"], parts["D2"]) for side, parts in found.items() if len(parts) == 3}


def with_knees_of_device(recording: Recording, file: str) -> Recording:
    """Return the recording with the knee markers that a device stands for and the file lacks, and F166 for them."""
    markers = recording.markers
    devices = _devices(markers.labels)
    used = {label for device in devices.values() for label in device}
    others = [label for label in markers.labels if label not in used]
    added: dict[str, FloatArray] = {}
    for side, device in devices.items():
        label = _like(f"{side}k{_KNEE}", device[0])
        if label not in markers.labels and others:
            corner = _corner(markers.select(device).positions, markers.select(others).positions)
            added |= {} if corner is None else {label: corner}
    if not added:
        return recording
    source = Quantity("the corner of the three stalks of the knee alignment device")
    note = finding("F166", Where(file), points=Quantity(", ".join(added)), source=source)
    positions = np.concatenate([markers.positions, np.stack(list(added.values()), axis=1)], axis=1)
    completed = Markers(markers.time, (*markers.labels, *added), positions)
    return replace(recording, markers=completed, findings=(*recording.findings, note))


def _like(label: str, model: str) -> str:
    """Return the label in the capitals of another one."""
    return label.lower() if model.islower() else label[:-4] + label[-4:].upper()


def _corner(device: FloatArray, others: FloatArray) -> FloatArray | None:
    """Return the corner (n, 3) m of three stalks; None where the markers are not at equal distances.

    Args:
        device: its markers (n, 3, 3) m.
        others: all other markers (n, m, 3) m: of the two corners possible, the one nearer to them is on the knee.
    """
    sides_m = np.linalg.norm(device - np.roll(device, 1, axis=1), axis=2)
    seen = np.isfinite(sides_m).all(axis=1) & np.asarray(np.isfinite(others).all(axis=2)).any(axis=1)
    usual_m = np.median(sides_m[seen], axis=0) if seen.any() else np.zeros(3)
    if not seen.any() or np.ptp(usual_m) > _UNEQUAL * usual_m.mean():
        return None
    normal = np.cross(device[:, 1] - device[:, 0], device[:, 2] - device[:, 0])
    normal *= (usual_m.mean() / np.sqrt(6.0) / np.linalg.norm(normal, axis=1))[:, None]
    body = np.nanmedian(others[seen], axis=1)
    middle = device.mean(axis=1)
    away = [float(np.median(np.linalg.norm((middle + sign * normal)[seen] - body, axis=1))) for sign in (1, -1)]
    corner: FloatArray = middle + (normal if away[0] < away[1] else -normal)
    return corner


def with_alignment_device(marker_set: MarkerSet, labels: Iterable[str]) -> MarkerSet:
    """Return the set for a static trial with devices: the axis marker in place of the thigh wand, by which Plug-in Gait
    finds the knee, and the medial malleoli (`LMED`) that are marked with it.
    """
    landmarks = dict(marker_set.landmarks)
    for side, device in _devices(labels).items():
        end = side[-1].lower()
        landmarks[f"thigh_wand_{end}"] = (device[0],)
        malleolus = _like(f"{side}{_MALLEOLUS}", device[0])
        if f"ankle_medial_{end}" not in landmarks and malleolus in labels:
            landmarks[f"ankle_medial_{end}"] = (malleolus,)
    return replace(marker_set, landmarks=landmarks)
