from dataclasses import replace

import ezc3d
import numpy as np
import pytest

from generic_static import recording, standing_positions
from kinertia.errors import MarkerSetError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.model import joint_centres as jc
from kinertia.model.gait27 import build_gait27
from kinertia.model.marker_set import MarkerSet
from kinertia.model.upper_body import torso_frame
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.synthetic.walk import HEIGHT_M
from synthetic_lab import MARKER_DIAMETER_M, symmetric_person

PLUG_IN = read_marker_set("plug-in-gait")


SAGITTAL = {"hip_flexion": "Hip", "knee_angle": "Knee", "ankle_angle": "Ankle"}
"""Coordinates, and what Plug-in Gait calls them."""


def standing(path, height_m):
    """Model of a static trial, origins of its segments in ground axes (m), and its angles (deg)."""
    static = read_recording(path)
    skeleton = build_gait27(static, PLUG_IN, height_m, "male").skeleton
    ik = solve_ik(skeleton, static.markers)
    pose = skeleton.pose(ik.q[:1])
    origins = dict(zip(skeleton.segments, pose.translation[0], strict=True))
    return static, origins, dict(zip(ik.coordinates, np.degrees(ik.q.mean(axis=0)), strict=True))


@pytest.fixture(scope="module", params=[("a", 1.61), ("b", 1.505)], ids=["A", "B"])
def vicon(request, measured_folder):
    """Our static model and its angles (deg), and Plug-in Gait's own outputs in ground axes (m, deg)."""
    subject, height = request.param
    path = measured_folder / "pig_c3d" / f"subject_{subject}_static.c3d"
    static, origins, angles = standing(path, height)
    file = ezc3d.c3d(str(path))
    labels = file["parameters"]["POINT"]["LABELS"]["value"]
    mean = dict(zip(labels, file["data"]["points"][:3].mean(axis=2).T, strict=True))
    median = jc.find_landmarks(static, PLUG_IN).markers
    lab = np.array([mean[label] for label in median]) * 1e-3
    to_ground, *_ = np.linalg.lstsq(lab, np.array(list(median.values())), rcond=None)
    return origins, angles, mean, to_ground


def test_knee_and_ankle_centres_are_plug_in_gaits(vicon):
    """Within the difference of the hip centres (Bell's, not Davis') and the medians' from the means."""
    origins, _, mean, to_ground = vicon
    for side in "rl":
        for segment, label, tolerance in (("shank", "FEO", 0.004), ("talus", "TIO", 0.002)):
            theirs = 1e-3 * mean[side.upper() + label] @ to_ground
            assert np.linalg.norm(origins[f"{segment}_{side}"] - theirs) < tolerance, (segment, side)


def test_sagittal_angles_are_plug_in_gaits(vicon):
    _, angles, mean, _ = vicon
    for side in "rl":
        for coordinate, output in SAGITTAL.items():
            theirs = mean[f"{side.upper()}{output}Angles"][0]
            assert angles[f"{coordinate}_{side}"] == pytest.approx(theirs, abs=2.0), (coordinate, side)


@pytest.mark.parametrize("side", "rl")
def test_joints_by_widths_are_the_persons(synthetic_lab, side):
    """Centres half a width inward of the marker, as close to the truth as a level axis is to that of a tilted ankle."""
    static, origins, angles = standing(synthetic_lab / "static.c3d", HEIGHT_M)
    person = symmetric_person()
    ik = solve_ik(person.skeleton, person.static.markers)
    true = dict(zip(ik.coordinates, np.degrees(ik.q.mean(axis=0)), strict=True))
    pose = person.skeleton.pose(ik.q[:1])
    centres = dict(zip(person.skeleton.segments, pose.translation[0], strict=True))
    marks = jc.find_landmarks(static, PLUG_IN)
    for joint, segment in (("knee", "shank"), ("ankle", "talus")):
        centre, outer = origins[f"{segment}_{side}"], marks[f"{joint}_lateral_{side}"]
        width = static.measurements[f"{side.upper()}{joint.capitalize()}Width"] + MARKER_DIAMETER_M
        assert np.linalg.norm(centre - outer) == pytest.approx(width / 2, abs=1e-3)
        assert np.linalg.norm((centre - centres[f"{segment}_{side}"])[[0, 2]]) < 0.003
    for coordinate in SAGITTAL:
        assert angles[f"{coordinate}_{side}"] == pytest.approx(true[f"{coordinate}_{side}"], abs=2.0)


def test_hip_regressions_by_hand():
    np.testing.assert_allclose(jc.hip_in_pelvis(0.25, 0.14, "bell", "r"), [-0.0475, -0.075, 0.09])
    expected = [-0.24 * 0.14 - 0.0099, -0.30 * 0.25 - 0.0109, -(0.33 * 0.25 + 0.0073)]
    np.testing.assert_allclose(jc.hip_in_pelvis(0.25, 0.14, "harrington", "l"), expected)


def test_chord_sees_the_joint_half_a_width_from_the_marker_and_square_to_the_thigh():
    hip, lateral, wand = np.array([0.0, 0.9, 0.09]), np.array([0.0, 0.5, 0.15]), np.array([0.02, 0.7, 0.2])
    centre = jc._chord(hip, lateral, wand, 0.055)
    assert np.linalg.norm(centre - lateral) == pytest.approx(0.055)
    assert (centre - lateral) @ (centre - hip) == pytest.approx(0.0, abs=1e-12)
    normal = np.cross(hip - lateral, wand - lateral)
    assert (centre - lateral) @ normal == pytest.approx(0.0, abs=1e-12)
    assert centre[2] < lateral[2]


def test_pelvis_frame_by_hand():
    marks = jc.find_landmarks(recording(standing_positions(2.0)), read_marker_set("cleveland-clinic"))
    rotation, origin, width, depth = jc.pelvis_frame(marks)
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(origin, [0.06, 1.12, 0.0])
    assert width == pytest.approx(0.28)
    assert depth == pytest.approx(0.19)


def test_a_pelvis_by_the_psis_by_a_sacral_marker_or_by_one_psis():
    """Plug-in Gait's plane is that of ASIS and either; the side of a single PSIS does not matter."""
    labels = {"asis_r": ("A",), "asis_l": ("B",), "psis_r": ("C",), "psis_l": ("D",), "sacrum": ("E",)}
    named = MarkerSet("set", labels, {}, {})
    points = {"asis_r": [0.0, 1.0, 0.12], "asis_l": [0.0, 1.0, -0.12], "psis_r": [-0.15, 1.02, 0.05]}
    points |= {"psis_l": [-0.15, 1.02, -0.05], "sacrum": [-0.17, 1.01, 0.0]}
    points = {name: np.array(place) for name, place in points.items()}

    def frame_of(*missing):
        kept = {name: place for name, place in points.items() if name not in missing}
        return jc.pelvis_frame(jc.Landmarks({}, kept, {}, named))

    both = frame_of()
    for missing in (("sacrum",), ("psis_r", "sacrum"), ("psis_l", "sacrum")):
        for mine, expected in zip(frame_of(*missing), both, strict=True):
            np.testing.assert_allclose(mine, expected, atol=1e-12)
    for missing in (("psis_r", "psis_l"), ("psis_r",)):
        rotation, _, width, depth = frame_of(*missing)
        assert (width, depth) == pytest.approx((0.24, np.hypot(0.17, 0.01)))
        np.testing.assert_allclose(rotation[:, 0], np.array([0.17, -0.01, 0.0]) / depth, atol=1e-12)
    with pytest.raises(MarkerSetError):
        frame_of("psis_r", "psis_l", "sacrum")


def test_axes_of_the_left_foot_mirror_the_right():
    right, left = jc.subtalar_axis("r"), jc.subtalar_axis("l")
    np.testing.assert_allclose(left, right * [-1, -1, 1])
    assert np.linalg.norm(right) == pytest.approx(1.0)
    assert np.degrees(np.arcsin(right[1])) == pytest.approx(42.0)


def test_landmarks_are_medians_over_the_frames_that_show_them():
    static = recording(standing_positions(), frames=7)
    column = static.markers.labels.index("R.Heel")
    static.markers.positions[0, column] = np.nan
    static.markers.positions[1, column] += 1.0
    landmarks = jc.find_landmarks(static, read_marker_set("cleveland-clinic"))
    np.testing.assert_allclose(landmarks["heel_r"], standing_positions()["R.Heel"])


def test_plug_in_gait_without_widths_says_what_would_help():
    rng = np.random.default_rng(0)
    positions = {label: rng.normal(size=3) for label in PLUG_IN.labels}
    marks = jc.find_landmarks(recording(positions), PLUG_IN)
    with pytest.raises(MarkerSetError) as caught:
        jc.knee(marks, np.zeros(3), "r")
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("L105", "knee_r")


@pytest.mark.parametrize(("sex", "raised_deg", "share"), [("male", 8.0, 0.55), ("female", 14.0, 0.53)])
def test_cervical_joint_lies_above_the_line_from_c7_to_the_sternal_notch(sex, raised_deg, share):
    c7, notch, lumbar = np.array([-0.06, 1.5, 0.0]), np.array([0.08, 1.5, 0.0]), np.array([0.0, 1.0, 0.0])
    points = {"c7": c7, "sternal_notch": notch}
    points |= {"acromion_r": np.array([0.0, 1.48, 0.18]), "acromion_l": np.array([0.0, 1.48, -0.18])}
    marks = jc.Landmarks({}, points, {}, PLUG_IN)
    rotation, length, shoulders = torso_frame(marks, lumbar, 1.75, sex)
    angle = np.radians(raised_deg)
    top = c7 + share * 0.14 * np.array([np.cos(angle), np.sin(angle), 0.0])
    assert length == pytest.approx(np.linalg.norm(top - lumbar))
    np.testing.assert_allclose(lumbar + length * rotation[:, 1], top, atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(shoulders["l"], points["acromion_l"] - 0.17 * 0.36 * rotation[:, 1])


@pytest.mark.parametrize("turned_deg", [-20.0, 0.0, 25.0])
def test_an_ankle_without_medial_marker_and_width_follows_the_foot(turned_deg):
    """Not the pelvis, which a leg is rotated against in a frame of a walk."""
    positions = standing_positions()
    true = (positions["R.Ankle.Lat"] + positions["R.Ankle.Med"]) / 2
    c, s = np.cos(np.radians(turned_deg)), np.sin(np.radians(turned_deg))
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    for label in ("Ankle.Lat", "Heel", "Toe.Lat", "Toe.Med", "Toe.Tip"):
        positions[f"R.{label}"] = true + rotation @ (positions[f"R.{label}"] - true)
    without_medial = {label: at for label, at in positions.items() if "Ankle.Med" not in label}
    marks = replace(jc.find_landmarks(recording(without_medial), read_marker_set("cleveland-clinic")), stature_m=1.75)
    knee_at = (marks["knee_lateral_r"] + marks["knee_medial_r"]) / 2
    shank = jc.frame(knee_at - marks["ankle_lateral_r"], np.array([0.0, 0.0, 1.0]))
    centre, axis = jc.ankle(marks, knee_at, shank, "r")
    assert np.linalg.norm((centre - true)[[0, 2]]) < 0.008
    assert jc.rotation_outwards(axis, rotation, "r") == pytest.approx(np.radians(9.0), abs=np.radians(6.0))
