"""Builds the 14-segment, 27-DOF gait model from a static trial.

Four open chains leave the pelvis: hip (3), knee (1), ankle (2: talocrural and subtalar, with a massless talus
between), back (3), shoulder (2), elbow (1). Twelve of the fourteen segments carry mass. Signs are OpenSim's
(Rajagopal): flexion of hip, knee and elbow, dorsiflexion, adduction, internal rotation and inversion are positive; hip,
knee and shoulder angles are zero when segments are aligned, the ankle's when foot and shank are perpendicular.

Further axes are locked unless they are calibrated: the centres of hips, lumbar joint and shoulders in their parents,
the directions of the axes of knees, ankles and elbows, and the axial rotation of the upper arm and of the forearm,
which this model does not move but which differ between a T-pose and walking.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kinertia.errors import MarkerSetError, problem_of
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model import joint_centres as jc
from kinertia.model.anthropometry import BodyGeometry
from kinertia.model.coordinate_range import Range
from kinertia.model.marker_set import MarkerSet
from kinertia.model.skeleton import Axis, Joint, Marker, Skeleton
from kinertia.model.upper_body import ARM_SEGMENTS, arm, arm_is_known, torso_frame
from kinertia.trial.data import Recording

SHOULDER_OFFSETS = tuple(f"shoulder_{axis}_{side}" for side in "rl" for axis in "xyz")
HIP_OFFSETS = tuple(f"hip_{axis}_{side}" for side in "rl" for axis in "xyz")
LUMBAR_OFFSETS = tuple(f"lumbar_{axis}" for axis in "xyz")
AXIS_TILTS = tuple(f"{name}_tilt_{i}_{side}" for side in "rl" for name in ("knee", "ankle", "elbow") for i in "12")
LEG_AXIS_TILTS = tuple(name for name in AXIS_TILTS if not name.startswith("elbow"))
UPPER_ARM_ROTATIONS = ("arm_rot_r", "arm_rot_l")
ARM_ROTATIONS = tuple(f"{name}_{side}" for side in "rl" for name in ("arm_rot", "pro_sup"))
KNEES = ("knee_angle_r", "knee_angle_l")
ELBOWS = ("elbow_flex_r", "elbow_flex_l")

ARM_COORDINATES = tuple(f"{name}_{side}" for side in "rl" for name in ("arm_flex", "arm_add", "elbow_flex"))
"""Locked where no marker shows them, as with a lower-body marker set; all others must be visible in a trial."""

VIRTUAL_TRUNK = (
    Marker("(trunk, right)", "torso", np.array([0.0, 0.45, 0.3])),
    Marker("(trunk, left)", "torso", np.array([0.0, 0.45, -0.3])),
    Marker("(trunk, front)", "torso", np.array([0.3, 0.45, 0.0])),
)
"""Markers for a person without, or with too few, torso markers; at the height of the shoulders."""
ENOUGH_TRUNK_MARKERS = 3
"""Fewest torso markers: two of them and the lumbar joint may be nearly in line."""

_USUAL_DEG = {"arm_flex": (-90.0, 150.0), "arm_add": (-120.0, 60.0)}
"""Typical ranges of motion, slightly extended. They only select between equivalent poses: a joint goes beyond if its
markers do. The ranges of all other joints are anatomical (`range_of_motion`)."""
_ELBOW_DEG = (-5.0, 159.7)
"""Clamped range: an arm without markers of its own that is rotated by half a turn, with the elbow bent backwards, fits
as well."""

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


Frame = tuple[np.ndarray, np.ndarray]
"""Axes (3, 3) and origin (3,) m of a segment."""


@dataclass(frozen=True)
class Gait27:
    """The model of one person.

    Attributes:
        skeleton: 27 free coordinates; markers at their positions in the static trial.
        geometry: joint centres and lengths that the anthropometric tables are scaled with.
    """

    skeleton: Skeleton
    geometry: BodyGeometry


def build_gait27(
    static: Recording,
    marker_set: MarkerSet,
    height_m: float,
    sex: str,
    hip_centre: str = "bell",
    by_stature: bool = False,
) -> Gait27:
    """Build segment frames, joint centres and axes, and marker positions in their segments, from a static trial.

    Args:
        static: a person standing; arms hanging or raised. Feet flat on the ground. Of trunk and arms any landmark may
            be missing (`assumptions`).
        marker_set: assignment of labels to landmarks, and of markers to segments.
        height_m: stature, for lengths that markers do not show (arms, and the torso without C7).
        sex: "male" or "female", for the lumbar and cervical joints.
        hip_centre: "bell" (1990) or "harrington" (2007).
        by_stature: place knees and ankles by stature where neither medial markers nor widths show them.

    Raises:
        MarkerSetError: a landmark that a joint of pelvis or legs needs is missing (the message gives the joint and the
            nearest labels), or landmarks coincide or lie in line, so that they define no frame.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        marks = jc.find_landmarks(static, marker_set)
        return _built(replace(marks, stature_m=height_m) if by_stature else marks, height_m, sex, hip_centre)


def _built(marks: jc.Landmarks, height_m: float, sex: str, hip_centre: str) -> Gait27:
    pelvis, origin, width, depth = jc.pelvis_frame(marks)
    frames = {"pelvis": (pelvis, origin)}
    joints = [_root()]
    lengths: dict[str, float] = {}
    hips = {side: jc.hip_in_pelvis(width, depth, hip_centre, side) for side in "rl"}
    for side in "rl":
        joints += _leg(marks, frames, lengths, hips[side], side)
    lumbar = jc.lumbar_in_pelvis(width, sex)
    back = _offsets(LUMBAR_OFFSETS) + _gimbal("lumbar_", ["extension", "bending", "rotation"])
    joints.append(Joint("pelvis", "torso", np.eye(3), lumbar, back))
    at = origin + pelvis @ lumbar
    torso, lengths["torso"], shoulders = torso_frame(marks, at, height_m, sex)
    frames["torso"] = (torso, at)
    _expect_axes(marks, [*joints, Joint("pelvis", "torso", torso, at, ())])
    locked = dict.fromkeys((*SHOULDER_OFFSETS, *HIP_OFFSETS, *LUMBAR_OFFSETS, *AXIS_TILTS), 0.0)
    for side in "rl":
        joints += _arm(marks, frames, lengths, locked, shoulders[side], height_m, sex, side)
    mid_hip = (hips["r"] + hips["l"]) / 2
    _expect_axes(marks, joints)
    worn = _markers(marks, frames)
    if sum(marker.segment == "torso" for marker in worn) < ENOUGH_TRUNK_MARKERS:
        worn = (*worn, *VIRTUAL_TRUNK)
    skeleton = Skeleton("gait27", tuple(joints), worn, locked, ranges=_ranges(joints))
    return Gait27(skeleton, BodyGeometry(_triple(lumbar), _triple(mid_hip), lengths))


def _expect_axes(marks: jc.Landmarks, joints: Sequence[Joint]) -> None:
    """Raise S206 if landmarks coincide or lie in line, so that they define no frame."""
    for joint in joints:
        directions = [axis.direction for axis in joint.axes]
        if not all(np.isfinite(part).all() for part in (joint.rotation, joint.translation, directions)):
            parts = joint.child if joint.parent == "ground" else f"{joint.child} or {joint.parent}"
            found = finding("S206", Where(part=parts), landmarks=Quantity(_landmarks_of(marks, joint)))
            raise MarkerSetError(problem_of(found)).with_finding(found)


def _landmarks_of(marks: jc.Landmarks, joint: Joint) -> str:
    """Return the landmarks whose labels are on the two segments of a joint."""
    labels = {label for name in (joint.parent, joint.child) for label in marks.marker_set.segments.get(name, ())}
    return ", ".join(
        name for name, landmark_labels in marks.marker_set.landmarks.items() if labels & set(landmark_labels)
    )


def _ranges(joints: list[Joint]) -> dict[str, Range]:
    ranges = {}
    for name in sorted({axis.coordinate for joint in joints for axis in joint.axes}):
        ends = _ELBOW_DEG if name in ELBOWS else _USUAL_DEG.get(name.removesuffix("_r").removesuffix("_l"))
        if ends is not None:
            low, high = np.radians(ends).tolist()
            ranges[name] = Range(low, high, clamped=name in ELBOWS)
    return ranges


def _root() -> Joint:
    axes = [Axis(f"pelvis_t{name}", "translation", d) for name, d in zip("xyz", (_X, _Y, _Z), strict=True)]
    turns = zip(("tilt", "list", "rotation"), (_Z, _X, _Y), strict=True)
    axes += [Axis(f"pelvis_{name}", "rotation", d) for name, d in turns]
    return Joint("ground", "pelvis", np.eye(3), np.zeros(3), tuple(axes))


def _gimbal(prefix: str, names: list[str], suffix: str = "", side: str = "r") -> tuple[Axis, ...]:
    directions = (np.array(_Z), *(jc.mirrored_axis(np.array(d), side) for d in (_X, _Y)))
    return tuple(
        Axis(f"{prefix}{name}{suffix}", "rotation", _triple(d)) for name, d in zip(names, directions, strict=False)
    )


def _offsets(names: tuple[str, ...], side: str = "") -> tuple[Axis, ...]:
    """Return three translations that move a joint centre in its parent, for calibration."""
    of_side = [name for name in names if name.endswith(side)]
    return tuple(Axis(name, "translation", d) for name, d in zip(of_side, (_X, _Y, _Z), strict=True))


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    result: np.ndarray = Rotation.from_rotvec(np.asarray(axis) * angle).as_matrix()
    return result


def _pin(parent: str, child: str, at: np.ndarray, relative: np.ndarray, axis: Axis, angle: float) -> Joint:
    """Return a pin joint that orients the child as `relative` in the parent when its coordinate is `angle`."""
    return Joint(parent, child, relative @ _turn(np.array(axis.direction), angle).T, at, _tiltable(axis))


def _tiltable(axis: Axis) -> tuple[Axis, ...]:
    """Return the axis with its direction open to calibration: rotated by two small angles before, and back after it.

    At coordinate zero the child does not move: only the effect of the axis' rotation changes.
    """
    joint, _, side = axis.coordinate.split("_")
    main = np.array(axis.direction)
    first = np.cross(main, jc.mirrored_axis(np.eye(3)[int(np.argmin(np.abs(main)))], side))
    turns = [_axis(f"{joint}_tilt_{i}_{side}", d) for i, d in zip("12", (first, np.cross(main, first)), strict=True)]
    back = [Axis(turn.coordinate, "rotation", _triple(-np.array(turn.direction))) for turn in reversed(turns)]
    return (*turns, axis, *back)


def _axis(coordinate: str, direction: np.ndarray) -> Axis:
    unit = direction / np.linalg.norm(direction)
    return Axis(coordinate, "rotation", _triple(unit))


def _triple(vector: ArrayLike) -> tuple[float, float, float]:
    x, y, z = map(float, np.asarray(vector))
    return x, y, z


def _leg(
    marks: jc.Landmarks, frames: dict[str, Frame], lengths: dict[str, float], hip: np.ndarray, side: str
) -> list[Joint]:
    pelvis, origin = frames["pelvis"]
    hip_at = origin + pelvis @ hip
    leg = jc.leg_frames(marks, hip_at, side)
    thigh, shank, foot = leg.thigh, leg.shank, leg.foot
    lengths[f"thigh_{side}"] = float(np.linalg.norm(hip_at - leg.knee_at))
    lengths[f"shank_{side}"] = float(np.linalg.norm(leg.knee_at - leg.ankle_at))
    lengths[f"foot_{side}"] = float(np.linalg.norm(marks[f"metatarsal_{side}"] - leg.ankle_at))
    lengths[f"foot_total_{side}"] = leg.foot_length
    drop = jc.subtalar_in_talus(leg.foot_length)
    frames[f"thigh_{side}"] = (thigh, hip_at)
    frames[f"shank_{side}"] = (shank, leg.knee_at)
    frames[f"foot_{side}"] = (foot, leg.ankle_at + foot @ drop)

    in_thigh = thigh.T @ shank
    flexion = np.arctan2(in_thigh[0, 1], in_thigh[1, 1])
    knee_pin = _axis(f"knee_angle_{side}", -(shank.T @ thigh[:, 2]))
    in_shank = shank.T @ foot
    dorsiflexion = np.arctan2(in_shank[1, 0], in_shank[0, 0])
    ankle_pin = _axis(f"ankle_angle_{side}", foot.T @ leg.ankle_axis)
    subtalar_pin = _axis(f"subtalar_angle_{side}", jc.subtalar_axis(side))
    down = np.array([0.0, -1.0, 0.0])
    hip_axes = _offsets(HIP_OFFSETS, side) + _gimbal("hip_", ["flexion", "adduction", "rotation"], f"_{side}", side)
    return [
        Joint("pelvis", f"thigh_{side}", np.eye(3), hip, hip_axes),
        _pin(f"thigh_{side}", f"shank_{side}", lengths[f"thigh_{side}"] * down, in_thigh, knee_pin, flexion),
        _pin(
            f"shank_{side}",
            f"talus_{side}",
            lengths[f"shank_{side}"] * down,
            in_shank,
            ankle_pin,
            dorsiflexion,
        ),
        Joint(f"talus_{side}", f"foot_{side}", np.eye(3), drop, (subtalar_pin,)),
    ]


def _arm(
    marks: jc.Landmarks,
    frames: dict[str, Frame],
    lengths: dict[str, float],
    locked: dict[str, float],
    shoulder: np.ndarray,
    height_m: float,
    sex: str,
    side: str,
) -> list[Joint]:
    torso, torso_at = frames["torso"]
    elbow_at, wrist_at, elbow_axis = arm(marks, shoulder, torso, height_m, sex, side)
    upper = jc.frame(shoulder - elbow_at, elbow_axis)
    lower = jc.frame(elbow_at - wrist_at, upper[:, 2])
    frames[f"upper_arm_{side}"] = (upper, shoulder)
    frames[f"forearm_{side}"] = (lower, elbow_at)
    lengths[f"upper_arm_{side}"] = float(np.linalg.norm(shoulder - elbow_at))
    lengths[f"forearm_{side}"] = float(np.linalg.norm(elbow_at - wrist_at))

    angles = Rotation.from_matrix(torso.T @ upper).as_euler("ZXY")
    locked[f"arm_rot_{side}"] = float(angles[2] if side == "r" else -angles[2])
    locked[f"pro_sup_{side}"] = 0.0
    in_upper = upper.T @ lower
    flexion = np.arctan2(-in_upper[0, 1], in_upper[1, 1])
    elbow_pin = _axis(f"elbow_flex_{side}", lower.T @ upper[:, 2])
    shoulder_axes = _offsets(SHOULDER_OFFSETS, side) + _gimbal("arm_", ["flex", "add", "rot"], f"_{side}", side)
    elbow = _pin(
        f"upper_arm_{side}",
        f"forearm_{side}",
        np.array([0.0, -lengths[f"upper_arm_{side}"], 0.0]),
        in_upper,
        elbow_pin,
        flexion,
    )
    twist = _axis(f"pro_sup_{side}", jc.mirrored_axis(np.array(_Y), side))
    return [
        Joint("torso", f"upper_arm_{side}", np.eye(3), torso.T @ (shoulder - torso_at), shoulder_axes),
        Joint(elbow.parent, elbow.child, elbow.rotation, elbow.translation, (*elbow.axes, twist)),
    ]


def _markers(marks: jc.Landmarks, frames: dict[str, Frame]) -> tuple[Marker, ...]:
    """Return the markers that the trial shows, in their segments, except those of an arm whose pose is unknown."""
    placed = []
    for segment, labels in marks.marker_set.segments.items():
        rotation, origin = frames[segment]
        if segment.startswith(ARM_SEGMENTS) and not arm_is_known(marks, segment[-1]):
            continue
        for label in labels:
            if label in marks.markers:
                placed.append(Marker(label, segment, rotation.T @ (marks.markers[label] - origin)))
    return tuple(placed)
