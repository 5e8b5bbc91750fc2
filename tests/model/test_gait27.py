import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from generic_static import generic_model, generic_static, recording, standing_positions
from kinertia.errors import MarkerSetError
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.gait27 import (
    ARM_COORDINATES,
    ARM_ROTATIONS,
    AXIS_TILTS,
    HIP_OFFSETS,
    LUMBAR_OFFSETS,
    SHOULDER_OFFSETS,
    VIRTUAL_TRUNK,
    build_gait27,
)
from kinertia.motion.inverse_kinematics import solve_ik

CLEVELAND = read_marker_set("cleveland-clinic")
MASSLESS = {"talus_r", "talus_l"}


def built(positions):
    return build_gait27(recording(positions), CLEVELAND, 1.75, "male")


def test_fourteen_segments_and_27_coordinates():
    skeleton = generic_model().skeleton
    assert len(set(skeleton.segments) - MASSLESS) == 12
    assert len(skeleton.segments) == 14
    assert len(skeleton.coordinates) == 27
    assert skeleton.coordinates[:6] == (
        "pelvis_tx",
        "pelvis_ty",
        "pelvis_tz",
        "pelvis_tilt",
        "pelvis_list",
        "pelvis_rotation",
    )
    assert set(skeleton.locked) == {*SHOULDER_OFFSETS, *HIP_OFFSETS, *LUMBAR_OFFSETS, *ARM_ROTATIONS, *AXIS_TILTS}
    assert set(ARM_COORDINATES) <= set(skeleton.coordinates)


def test_the_static_trial_is_fitted_exactly_at_plausible_angles():
    static = generic_static()
    skeleton = generic_model().skeleton
    ik = solve_ik(skeleton, static.markers)
    assert ik.marker_rms_m < 1e-3
    angles = dict(zip(ik.coordinates, np.degrees(ik.q[0]), strict=True))
    for name in skeleton.coordinates[3:]:
        assert abs(angles[name]) < 35.0, name
    assert angles["elbow_flex_r"] > 5.0


def test_left_mirrors_right():
    skeleton = generic_model().skeleton
    q = solve_ik(skeleton, generic_static().markers).q[0]
    values = dict(zip(skeleton.coordinates, q, strict=True))
    for name in skeleton.coordinates:
        if name.endswith("_r"):
            assert values[name] == pytest.approx(values[name[:-2] + "_l"], abs=1e-6), name
    mirror = np.diag([1.0, 1.0, -1.0])
    joints = {joint.child: joint for joint in skeleton.joints}
    for child, joint in joints.items():
        if not child.endswith("_r"):
            continue
        other = joints[child[:-2] + "_l"]
        np.testing.assert_allclose(other.translation, mirror @ joint.translation, atol=1e-12)
        np.testing.assert_allclose(other.rotation, mirror @ joint.rotation @ mirror, atol=1e-12)
        for right, left in zip(joint.axes, other.axes, strict=True):
            if right.kind == "rotation":
                # an axis of rotation is an axial vector: its mirror image is the mirrored vector turned round
                np.testing.assert_allclose(left.direction, -mirror @ right.direction, atol=1e-12)
    places = {m.label: m.position for m in skeleton.markers}
    for label, at in places.items():
        if label.startswith("R."):
            np.testing.assert_allclose(places["L." + label[2:]], mirror @ at, atol=1e-12)


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 180.0, -90.0])
def test_the_model_does_not_depend_on_where_the_person_stands_and_faces(heading_deg):
    turn = Rotation.from_euler("y", heading_deg, degrees=True).as_matrix()
    moved = {label: turn @ at + [0.3, 0.0, -2.0] for label, at in standing_positions().items()}
    here, there = generic_model().skeleton, built(moved).skeleton
    np.testing.assert_allclose(there.marker_locals, here.marker_locals, atol=1e-9)
    for a, b in zip(here.joints, there.joints, strict=True):
        np.testing.assert_allclose(b.rotation, a.rotation, atol=1e-9)
        np.testing.assert_allclose(b.translation, a.translation, atol=1e-9)


@pytest.mark.parametrize(
    ("coordinate", "label", "axis", "sign"),
    [
        ("hip_flexion_r", "R.Knee.Lat", 0, 1),
        ("hip_adduction_r", "R.Ankle.Lat", 2, -1),
        ("hip_adduction_l", "L.Ankle.Lat", 2, 1),
        ("hip_rotation_r", "R.Toe.Tip", 2, -1),
        ("hip_rotation_l", "L.Toe.Tip", 2, 1),
        ("knee_angle_r", "R.Ankle.Lat", 0, -1),
        ("knee_angle_l", "L.Ankle.Lat", 0, -1),
        ("ankle_angle_r", "R.Toe.Tip", 1, 1),
        ("ankle_angle_l", "L.Toe.Tip", 1, 1),
        ("subtalar_angle_r", "R.Toe.Lat", 1, -1),
        ("subtalar_angle_l", "L.Toe.Lat", 1, -1),
        ("arm_flex_r", "R.Elbow", 0, 1),
        ("arm_add_r", "R.Elbow", 2, -1),
        ("arm_add_l", "L.Elbow", 2, 1),
        ("elbow_flex_r", "R.Wrist.Lat", 0, 1),
        ("elbow_flex_l", "L.Wrist.Lat", 0, 1),
        ("pelvis_tilt", "V.Sacral", 1, -1),
        ("lumbar_extension", "Top.Head", 0, -1),
    ],
)
def test_positive_angles_move_the_body_as_their_names_say(coordinate, label, axis, sign):
    skeleton = generic_model().skeleton
    q = np.zeros((2, 27))
    q[1, skeleton.coordinates.index(coordinate)] = 0.2
    at = skeleton.marker_positions(skeleton.pose(q))[:, skeleton.labels.index(label)]
    assert sign * (at[1] - at[0])[axis] > 0.002


NEEDED = {
    "R.ASIS": "pelvis",
    "V.Sacral": "pelvis",
    "L.Knee.Lat": "knee_l",
    "R.Ankle.Lat": "ankle_r",
    "R.Heel": "foot_r",
    "L.Toe.Med": "foot_l",
}


@pytest.mark.parametrize(("label", "joint"), NEEDED.items())
def test_a_missing_landmark_names_the_joint_and_the_nearest_label(label, joint):
    positions = standing_positions()
    positions[label.replace(".", "")] = positions.pop(label)
    with pytest.raises(MarkerSetError) as caught:
        built(positions)
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("L105", joint)
    assert caught.value.missing
    assert label.replace(".", "") in str(caught.value)


@pytest.mark.parametrize("joint", ["Knee", "Ankle"])
def test_knees_and_ankles_need_one_medial_marker(joint):
    """The other side's mirrors it; without either there is no joint."""
    whole = generic_model().skeleton
    positions = standing_positions()
    positions.pop(f"R.{joint}.Med")
    for mine, expected in zip(built(positions).skeleton.joints, whole.joints, strict=True):
        np.testing.assert_allclose(mine.translation, expected.translation, atol=1e-12)
        np.testing.assert_allclose(mine.rotation, expected.rotation, atol=1e-12)
    positions.pop(f"L.{joint}.Med")
    with pytest.raises(MarkerSetError) as caught:
        built(positions)
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("L105", f"{joint.lower()}_r")
    assert f"{joint.lower()}_medial_r" in str(caught.value)


@pytest.mark.parametrize("gone", ["Acromium", "Elbow", "Wrist", "Temple", "Bicep"])
def test_a_model_needs_no_marker_above_the_pelvis(gone):
    """Its legs are the same with or without them."""
    whole = generic_model().skeleton
    model = built({label: at for label, at in standing_positions().items() if gone not in label})
    legs = [k for k, joint in enumerate(whole.joints) if joint.child.startswith(("thigh", "shank", "talus", "foot"))]
    for k in legs:
        np.testing.assert_array_equal(model.skeleton.joints[k].translation, whole.joints[k].translation)
    assert len(model.skeleton.coordinates) == 27


def test_fewer_than_three_markers_of_the_trunk_are_helped_by_an_upright_one():
    positions = standing_positions()
    assert VIRTUAL_TRUNK[0].label not in built(positions).skeleton.labels
    for label in ("R.Temple", "L.Temple", "Top.Head", "Sternum"):
        positions.pop(label)
    labels = built(positions).skeleton.labels
    assert {"R.Acromium", "L.Acromium", *(marker.label for marker in VIRTUAL_TRUNK)} <= set(labels)


def test_markers_of_an_arm_whose_pose_is_not_shown_are_not_used():
    positions = {label: at for label, at in standing_positions().items() if label not in _ARM[1:]}
    assert "R.Bicep" not in built(positions).skeleton.labels
    assert "L.Bicep" in built(positions).skeleton.labels


def test_landmarks_on_one_point_are_an_error_that_names_the_segment():
    positions = standing_positions()
    positions["R.Knee.Med"] = positions["R.Knee.Lat"]
    with pytest.raises(MarkerSetError) as caught:
        built(positions)
    assert (caught.value.finding.code, caught.value.finding.where.part) == ("S206", "shank_r or thigh_r")


def test_an_arm_without_markers_hangs_with_lengths_by_stature():
    positions = {label: at for label, at in standing_positions().items() if label not in _ARM}
    model = built(positions)
    assert len(model.skeleton.coordinates) == 27
    assert model.geometry.lengths_m["upper_arm_r"] == pytest.approx(0.2817 / 1.741 * 1.75)
    assert model.geometry.lengths_m["upper_arm_l"] == generic_model().geometry.lengths_m["upper_arm_l"]
    joint = next(j for j in model.skeleton.joints if j.child == "forearm_r")
    np.testing.assert_allclose(joint.rotation, np.eye(3), atol=1e-9)
    assert model.skeleton.locked["arm_rot_r"] == pytest.approx(0.0, abs=1e-9)


_ARM = ("R.Bicep", "R.Elbow", "R.Wrist.Lat", "R.Wrist.Med")


def test_a_marker_that_the_static_trial_never_shows_is_left_out():
    positions = standing_positions()
    positions["R.Thigh.Rear"] = np.full(3, np.nan)
    assert "R.Thigh.Rear" not in built(positions).skeleton.labels


def test_a_tilted_axis_leaves_the_straight_joint_alone():
    skeleton = generic_model().skeleton
    tilted = skeleton.lock({"knee_tilt_1_r": 0.1, "knee_tilt_2_r": -0.05})
    knee, shank = skeleton.coordinates.index("knee_angle_r"), skeleton.segments.index("shank_r")
    q = np.zeros((2, 27))
    q[1, knee] = 1.0
    before, after = skeleton.pose(q), tilted.pose(q)
    np.testing.assert_allclose(after.rotation[0], before.rotation[0], atol=1e-12)
    turned = Rotation.from_matrix(after.rotation[1, shank] @ after.rotation[0, shank].T).as_rotvec()
    was = Rotation.from_matrix(before.rotation[1, shank] @ before.rotation[0, shank].T).as_rotvec()
    assert np.linalg.norm(turned) == pytest.approx(1.0)
    assert np.arccos(turned @ was) == pytest.approx(np.hypot(0.1, 0.05), rel=0.01)
