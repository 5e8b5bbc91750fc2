"""Computes joint centres, axes and segment frames of pelvis and legs from a static trial's landmarks.

All points are in ground axes (m). Frames follow ISB: x anterior, y up or proximal, z right. Sources: hip Bell et al.
(1990) or Harrington et al. (2007); knee and ankle midpoints of the epicondyles and malleoli, or Plug-in Gait's chord
construction without medial markers (Davis et al. 1991); talocrural and subtalar axes Inman (1976); lumbar joint Dumas
et al. (2007).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinertia.errors import MarkerSetError, problem_of
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where
from kinertia.model.marker_set import MarkerSet, nearest_labels
from kinertia.model.skeleton import mirrored
from kinertia.trial.data import Recording

MARKER_RADIUS_M = 0.007
_WIDTHS_OF_STATURE = {"knee": 0.067, "ankle": 0.042}
"""Mean of eight children and adults, whose widths differ by 15 %."""
_MALLEOLI_RAD = float(np.radians(9.0))
"""How far the line of the malleoli is rotated outwards from the perpendicular to the foot: 26 legs of 13 people have
9 degrees, SD 5; from the line of the ASIS it is 17, SD 8, in standing."""
_TALOCRURAL_RIGHT = np.array([-0.105, -0.174, 0.979])
_SUBTALAR_INCLINATION, _SUBTALAR_DEVIATION = np.radians(42.0), np.radians(23.0)
_SUBTALAR_DROP_OF_FOOT = 0.018
_METATARSALS_OF_FOOT = 0.73
_LUMBAR = {"male": np.array([-0.335, -0.032, 0.0]), "female": np.array([-0.340, 0.049, 0.0])}


@dataclass(frozen=True)
class WandLimit:
    """How far a wand may rotate the axis of a joint from the line that is expected there.

    Attributes:
        wand: landmark of the wand, without its side.
        line: the expected line, in words.
        limit_rad: rotation beyond which the wand is not believed.
        usual_rad: largest rotation by a wand that was where it should be.
    """

    wand: str
    line: str
    limit_rad: float
    usual_rad: float


WAND_LIMITS = {
    "knee": WandLimit("thigh_wand", "the line of the ASIS", float(np.radians(30.0)), float(np.radians(19.0))),
    "ankle": WandLimit(
        "shank_wand", "the malleoli expected above the foot", float(np.radians(45.0)), float(np.radians(32.0))
    ),
}
"""Of knees by ten people, where wands on the front of the thigh rotate the axis by 44 degrees; of ankles by twelve,
where a wand on the other side of the shin rotates it by 136."""


@dataclass(frozen=True)
class Landmarks:
    """Positions of the markers and landmarks of a static trial.

    Attributes:
        markers: label -> (3,) m in ground axes, the median over the frames; only those that the trial shows.
        points: landmark -> (3,) m in ground axes; only those that the trial shows.
        widths: joint -> width in m; only those stated in the trial.
        marker_set: source of the names.
        stature_m: if given, it places knees and ankles that have neither medial marker nor wand.
    """

    markers: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]
    widths: Mapping[str, float]
    marker_set: MarkerSet
    stature_m: float | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.points[name]

    def __contains__(self, name: str) -> bool:
        return name in self.points

    def width(self, joint: str) -> float | None:
        """Return the width (m) of a joint, or of the other side's joint if only that was measured."""
        return self.widths.get(joint, self.widths.get(mirrored(joint)))

    def require(self, joint: str, *names: str) -> None:
        """Raise MarkerSetError if a landmark that this joint needs is missing."""
        missing = [name for name in names if name not in self.points]
        if not missing:
            return
        wanted = [label for name in missing for label in self.marker_set.landmarks.get(name, ())]
        near = nearest_labels(wanted, list(self.markers))
        hints = [f"{label} (nearest: {' or '.join(n)})" if n else label for label, n in near.items()]
        labels = f"labels {', '.join(hints)}" if hints else "not named in the marker set"
        raise _missing(joint, f"{', '.join(missing)} ({labels})", missing, near)


def _missing(
    joint: str, landmark: str, missing: Sequence[str], nearest: Mapping[str, list[str]] | None = None
) -> MarkerSetError:
    """Make the error L105: what the static trial lacks for a joint."""
    found = finding("L105", Where(part=joint), landmark=Quantity(landmark))
    return MarkerSetError(problem_of(found), missing, dict(nearest or {})).with_finding(found)


def find_landmarks(static: Recording, marker_set: MarkerSet) -> Landmarks:
    """Compute the median position of every marker and landmark over the frames of a static trial.

    A landmark needs all its markers, except a wrist, which needs one of them.
    """
    markers = static.markers
    seen, medians = markers.seen, np.median(markers.positions, axis=0)
    median = {
        label: medians[i] if seen[:, i].all() else np.median(markers.positions[seen[:, i], i], axis=0)
        for i, label in enumerate(markers.labels)
        if seen[:, i].any()
    }
    points = {
        name: np.mean([median[label] for label in labels], axis=0)
        for name, labels in marker_set.landmarks.items()
        if all(label in median for label in labels)
    }
    for wrist in ("wrist_r", "wrist_l"):
        worn = [median[label] for label in marker_set.landmarks.get(wrist, ()) if label in median]
        if worn:
            points[wrist] = np.mean(worn, axis=0)
    widths = {
        joint: static.measurements[name]
        for joint, name in marker_set.widths.items()
        if static.measurements.get(name, 0.0) > 0.0
    }
    return Landmarks(median, points, widths, marker_set)


def frame(y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) whose y axis is along y and whose z axis is as close to z as possible."""
    y = y / np.linalg.norm(y)
    x = np.cross(y, z)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def pelvis_frame(marks: Landmarks) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return the pelvis' rotation, origin (mid ASIS), width (ASIS to ASIS) and depth, m.

    Depth is from mid ASIS to mid PSIS, or to the sacral marker. The plane of ASIS and PSIS, or of ASIS and sacrum, is
    Plug-in Gait's. A single PSIS replaces both.
    """
    psis = [name for name in ("psis_r", "psis_l") if name in marks]
    sacral = "sacrum" in marks or ("sacrum" in marks.marker_set.landmarks and not psis)
    back = psis if len(psis) == 2 else ["sacrum"] if sacral else psis or ["psis_r", "psis_l"]
    marks.require("pelvis", "asis_r", "asis_l", *back)
    origin = (marks["asis_r"] + marks["asis_l"]) / 2
    z = marks["asis_r"] - marks["asis_l"]
    behind = np.mean([marks[name] for name in back], axis=0) - origin
    if len(back) == 1 and back == psis:
        behind = behind - (behind @ z) / (z @ z) * z
    return frame(np.cross(behind, z), z), origin, float(np.linalg.norm(z)), float(np.linalg.norm(behind))


def hip_in_pelvis(width: float, depth: float, method: str, side: str) -> np.ndarray:
    """Return the hip centre in the pelvis frame (mid ASIS), m, by Bell et al. (1990) or Harrington et al. (2007)."""
    sign = _to_the_right(side)
    if method == "bell":
        return width * np.array([-0.19, -0.30, sign * 0.36])
    return np.array([-0.24 * depth - 0.0099, -0.30 * width - 0.0109, sign * (0.33 * width + 0.0073)])


def lumbar_in_pelvis(width: float, sex: str) -> np.ndarray:
    """Return the lumbar joint centre (L5/S1) in the pelvis frame, m, by Dumas et al. (2007)."""
    return width * _LUMBAR[sex]


@dataclass(frozen=True)
class LegFrames:
    """Joint centres (3,) m, axes (unit, to the right) and segment frames (3, 3) of a leg in the static trial."""

    hip_at: np.ndarray
    knee_at: np.ndarray
    ankle_at: np.ndarray
    knee_axis: np.ndarray
    ankle_axis: np.ndarray
    thigh: np.ndarray
    shank: np.ndarray
    foot: np.ndarray
    foot_length: float


def leg_frames(marks: Landmarks, hip_at: np.ndarray, side: str) -> LegFrames:
    """Find knee, ankle and foot of a leg below this hip centre (3,) m."""
    knee_at, knee_axis = knee(marks, hip_at, side)
    thigh = frame(hip_at - knee_at, knee_axis)
    marks.require(f"ankle_{side}", f"ankle_lateral_{side}")
    rough = frame(knee_at - marks[f"ankle_lateral_{side}"], thigh[:, 2])
    ankle_at, _ = ankle(marks, knee_at, rough, side)
    shank = frame(knee_at - ankle_at, thigh[:, 2])
    _, ankle_axis = ankle(marks, knee_at, shank, side)
    foot, foot_length = foot_frame(marks, side)
    return LegFrames(hip_at, knee_at, ankle_at, knee_axis, ankle_axis, thigh, shank, foot, foot_length)


def knee(marks: Landmarks, hip: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Return knee centre and flexion axis (unit, to the right)."""
    return _hinge(marks, "knee", hip, side)


def wand_rotation(marks: Landmarks, name: str, proximal: np.ndarray, side: str) -> float | None:
    """Return how far (rad) a wand rotates the axis of a "knee" or "ankle" outwards from the line that is expected
    there, about the segment below the proximal joint's centre (3,) m; None where no wand defines it.

    Where that is more than `WAND_LIMITS` allow, the expected line is used in its place.
    """
    wand, width = f"{WAND_LIMITS[name].wand}_{side}", marks.width(f"{name}_{side}")
    if wand not in marks or width is None or _medial(marks, name, side) is not None:
        return None
    lateral, sign = marks[f"{name}_lateral_{side}"], _to_the_right(side)
    _, axis = _hinge_along(lateral, proximal, width / 2 + MARKER_RADIUS_M, sign * (marks[wand] - lateral), sign)
    return rotation_outwards(axis, frame(proximal - lateral, _expected_line(marks, name, side)), side)


def rotation_outwards(axis: np.ndarray, frame_: np.ndarray, side: str) -> float:
    """Return the rotation (rad) of an axis to the right from the z axis of a frame (3, 3) about its y axis; positive
    where a foot that turned with it would point outwards.
    """
    return float(np.arctan2(-_to_the_right(side) * (axis @ frame_[:, 0]), axis @ frame_[:, 2]))


def ankle(marks: Landmarks, knee_centre: np.ndarray, shank: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Return ankle centre and talocrural axis (unit, to the right).

    The axis runs through the malleoli if both are marked, else it is Inman's in the shank frame (3, 3), or, for a
    centre by stature, in that frame rotated to the foot.
    """
    centre, across = _hinge(marks, "ankle", knee_centre, side)
    if _medial(marks, "ankle", side) is not None:
        return centre, across
    inman = mirrored_axis(_TALOCRURAL_RIGHT, side)
    if _by_stature(marks, "ankle", side):
        return centre, frame(knee_centre - centre, foot_frame(marks, side)[0][:, 2]) @ inman
    return centre, shank @ inman


def subtalar_axis(side: str) -> np.ndarray:
    """Return the subtalar axis in the foot frame (unit; inversion positive), Inman (1976): 42 deg up, 23 deg inward."""
    up, inward = _SUBTALAR_INCLINATION, _SUBTALAR_DEVIATION
    right = np.array([np.cos(up) * np.cos(inward), np.sin(up), -np.cos(up) * np.sin(inward)])
    return mirrored_axis(right, side)


def subtalar_in_talus(foot_length: float) -> np.ndarray:
    """Return a point of the subtalar axis below the ankle centre, m (Delp et al. 1990: 5 mm on a foot of 0.27 m)."""
    return np.array([0.0, -_SUBTALAR_DROP_OF_FOOT * foot_length, 0.0])


def mirrored_axis(right: np.ndarray, side: str) -> np.ndarray:
    """Return a rotation axis of the right side, or its mirror image on the left with the same sense of rotation."""
    return right if side == "r" else right * np.array([-1.0, -1.0, 1.0])


def _hinge(marks: Landmarks, name: str, proximal: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and axis (unit, to the right) of a knee or ankle by both sides of it, by its wand, or, where that
    is not believed or there is none, by the expected line.
    """
    joint, wand = f"{name}_{side}", f"{WAND_LIMITS[name].wand}_{side}"
    lateral, medial, sign = f"{name}_lateral_{side}", f"{name}_medial_{side}", _to_the_right(side)
    inner, width = _medial(marks, name, side), marks.width(joint)
    if inner is not None and lateral in marks:
        across = sign * (marks[lateral] - inner)
        return (marks[lateral] + inner) / 2, across / np.linalg.norm(across)
    by_stature = _by_stature(marks, name, side)
    if not (by_stature and lateral in marks):
        if width is None or wand not in marks:
            marks.require(joint, lateral, medial) if wand not in marks else marks.require(joint, lateral)
            stated = f"{name}_width_mm under [subject]"
            raise _missing(joint, f"a medial marker ({medial}) or its width ({stated}, or in the C3D file)", [medial])
        marks.require(joint, lateral, wand)
    half = (width or _WIDTHS_OF_STATURE[name] * (marks.stature_m or 0.0)) / 2 + MARKER_RADIUS_M
    if by_stature or abs(wand_rotation(marks, name, proximal, side) or 0.0) > WAND_LIMITS[name].limit_rad:
        across = _expected_line(marks, name, side)
    else:
        across = sign * (marks[wand] - marks[lateral])
    return _hinge_along(marks[lateral], proximal, half, across, sign)


def _by_stature(marks: Landmarks, name: str, side: str) -> bool:
    """Decide whether a joint without a medial marker is placed by stature: where width and wand do not show it."""
    wand = f"{WAND_LIMITS[name].wand}_{side}"
    return marks.stature_m is not None and (marks.width(f"{name}_{side}") is None or wand not in marks)


def _to_the_right(side: str) -> float:
    return 1.0 if side == "r" else -1.0


def _expected_line(marks: Landmarks, name: str, side: str) -> np.ndarray:
    """Return the line (unit, to the right) along which the axis of a knee or the malleoli are expected."""
    return _across_pelvis(marks) if name == "knee" else _malleoli_by_foot(marks, side)


def _malleoli_by_foot(marks: Landmarks, side: str) -> np.ndarray:
    """Return the line of the malleoli (unit, to the right) by the direction of the foot."""
    foot, _ = foot_frame(marks, side)
    outwards = _MALLEOLI_RAD if side == "r" else -_MALLEOLI_RAD
    result: np.ndarray = np.cos(outwards) * foot[:, 2] - np.sin(outwards) * foot[:, 0]
    return result


def _across_pelvis(marks: Landmarks) -> np.ndarray:
    """Return the line of the ASIS (unit, to the right)."""
    z = marks["asis_r"] - marks["asis_l"]
    result: np.ndarray = z / np.linalg.norm(z)
    return result


def _hinge_along(
    lateral: np.ndarray, proximal: np.ndarray, half: float, across: np.ndarray, sign: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a centre at distance `half` (m) from the lateral marker, in the plane of the line `across` to the right,
    and the axis through both.
    """
    centre = _chord(proximal, lateral, lateral + sign * across, half)
    axis = sign * (lateral - centre)
    return centre, axis / np.linalg.norm(axis)


def _medial(marks: Landmarks, joint: str, side: str) -> np.ndarray | None:
    """Return the medial marker of a knee or ankle, or the mirrored one of the other side without width and wand."""
    inner, wand = marks.points.get(f"{joint}_medial_{side}"), f"{WAND_LIMITS[joint].wand}_{side}"
    if inner is None and (marks.width(f"{joint}_{side}") is None or wand not in marks):
        inner = medial_by_the_other_side(marks, joint, side)
    return inner


def medial_by_the_other_side(marks: Landmarks, joint: str, side: str) -> np.ndarray | None:
    """Return the medial marker of a knee or ankle by mirroring the other side's about the pelvis; None if unknown."""
    lateral, medial = (f"{joint}_{which}_{side}" for which in ("lateral", "medial"))
    if not all(name in marks for name in (lateral, mirrored(lateral), mirrored(medial), "asis_r", "asis_l")):
        return None
    z = marks["asis_r"] - marks["asis_l"]
    inward = marks[mirrored(medial)] - marks[mirrored(lateral)]
    result: np.ndarray = marks[lateral] + inward - 2.0 * (inward @ z) / (z @ z) * z
    return result


def _chord(proximal: np.ndarray, lateral: np.ndarray, wand: np.ndarray, half: float) -> np.ndarray:
    """Return the joint centre by Plug-in Gait's chord construction (Davis et al. 1991).

    It is at distance `half` from the lateral marker, perpendicular to the line to the proximal joint, in the plane of
    proximal joint, marker and wand, on the side away from the wand.
    """
    up = proximal - lateral
    distance = np.linalg.norm(up)
    up = up / distance
    out = wand - lateral
    out = out - (out @ up) * up
    out = out / np.linalg.norm(out)
    cosine = half / distance
    result: np.ndarray = lateral + half * (cosine * up - np.sqrt(1 - cosine**2) * out)
    return result


def foot_frame(marks: Landmarks, side: str) -> tuple[np.ndarray, float]:
    """Return the rotation of the flat foot (x from heel to toe, y up) and its length from heel to toe tip, m.

    Without a marker on the toe tip the metatarsal heads are assumed to be at 73 % of the foot's length.
    """
    marks.require(f"foot_{side}", f"heel_{side}", f"metatarsal_{side}")
    heel, tip = marks[f"heel_{side}"], f"toe_{side}"
    x = (marks[tip if tip in marks else f"metatarsal_{side}"] - heel) * np.array([1.0, 0.0, 1.0])
    length = float(np.linalg.norm(x))
    x = x / length
    up = np.array([0.0, 1.0, 0.0])
    return np.column_stack([x, up, np.cross(x, up)]), length if tip in marks else length / _METATARSALS_OF_FOOT
