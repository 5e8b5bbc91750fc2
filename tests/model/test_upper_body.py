"""Trunk and arms of a static trial that shows only part of them, against the same trial with all of its markers."""

import numpy as np
import pytest

from generic_static import generic_model, recording, standing_positions
from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.anthropometry import reference_lengths
from kinertia.model.joint_centres import find_landmarks
from kinertia.model.skeleton import Marker
from kinertia.model.static_landmarks import assumptions
from kinertia.model.upper_body import arm, head_markers, torso_frame, without_head

CLEVELAND = read_marker_set("cleveland-clinic")


HEIGHT_M = 1.75


LUMBAR = np.array([0.0, 1.0, 0.0])


LENGTHS = reference_lengths(HEIGHT_M, "male")


def marks(*gone):
    positions = {label: at for label, at in standing_positions(HEIGHT_M).items() if label not in gone}
    return find_landmarks(recording(positions), CLEVELAND)


def right_arm(*gone):
    rotation, _, shoulders = torso_frame(marks(), LUMBAR, HEIGHT_M, "male")
    return arm(marks(*gone), shoulders["r"], rotation, HEIGHT_M, "male", "r"), shoulders["r"]


def test_one_acromion_mirrors_the_other():
    _, _, both = torso_frame(marks(), LUMBAR, HEIGHT_M, "male")
    _, _, mirrored = torso_frame(marks("R.Acromium"), LUMBAR, HEIGHT_M, "male")
    np.testing.assert_allclose(mirrored["r"] * [1, 1, -1], mirrored["l"], atol=1e-12)
    assert np.linalg.norm(mirrored["r"] - both["r"]) < 0.02


def test_without_acromia_the_trunk_is_upright_and_its_shoulders_by_stature():
    rotation, length, shoulders = torso_frame(marks("R.Acromium", "L.Acromium"), LUMBAR, HEIGHT_M, "male")
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)
    assert length == pytest.approx(LENGTHS["torso"])
    assert shoulders["r"][2] - shoulders["l"][2] == pytest.approx(0.2 * HEIGHT_M)


def test_an_arm_without_a_wrist_is_straight():
    whole, _ = right_arm()
    straight, shoulder = right_arm("R.Wrist.Lat", "R.Wrist.Med")
    upper, lower = straight.elbow - shoulder, straight.wrist - straight.elbow
    assert np.linalg.norm(lower) == pytest.approx(LENGTHS["forearm"])
    np.testing.assert_allclose(np.cross(upper, lower), 0.0, atol=1e-12)
    assert np.linalg.norm(straight.elbow - whole.elbow) < 0.015


def test_an_arm_without_an_elbow_has_it_between_shoulder_and_wrist():
    whole, _ = right_arm()
    between, shoulder = right_arm("R.Elbow")
    np.testing.assert_array_equal(between.wrist, whole.wrist)
    share = np.linalg.norm(between.elbow - shoulder) / np.linalg.norm(between.wrist - shoulder)
    assert share == pytest.approx(LENGTHS["upper_arm"] / (LENGTHS["upper_arm"] + LENGTHS["forearm"]))
    assert np.linalg.norm(between.elbow - whole.elbow) < 0.07


def test_one_marker_stands_for_a_wrist():
    whole, _ = right_arm()
    by_marker, _ = right_arm("R.Wrist.Med")
    assert np.linalg.norm(by_marker.wrist - whole.wrist) == pytest.approx(
        0.5 * HEIGHT_M * np.hypot(0.01, np.hypot(0.005, 0.035))
    )


ASSUMED = {
    (): [],
    ("R.Temple", "Top.Head"): [],
    ("R.Knee.Med",): [("knee_r", ("knee_medial_r",), True)],
    ("L.Ankle.Med",): [("ankle_l", ("ankle_medial_l",), True)],
    ("R.Acromium",): [
        ("torso", ("acromion_r", "c7", "sternal_notch"), False),
        ("shoulders", ("acromion_r",), False),
    ],
    ("L.Elbow",): [("arm_l", ("elbow_lateral_l",), False)],
    ("L.Wrist.Lat", "L.Wrist.Med"): [("arm_l", ("wrist_l",), False)],
    ("L.Wrist.Lat",): [("wrist_l", ("L.Wrist.Lat",), False)],
    ("R.Elbow", "R.Wrist.Lat", "R.Wrist.Med"): [("arm_r", ("elbow_lateral_r", "wrist_r"), False)],
    ("R.Bicep", "R.Elbow", "R.Wrist.Lat", "R.Wrist.Med"): [],
}


@pytest.mark.parametrize(("gone", "expected"), ASSUMED.items())
def test_what_is_assumed_in_place_of_each_landmark(gone, expected):
    """Nothing of an arm without any marker: the motion shows it no more than the static trial."""
    assert [
        (assumption.part, assumption.lacking, assumption.of_leg) for assumption in assumptions(marks(*gone))
    ] == expected


def test_a_width_of_one_side_stands_for_both():
    plug_in = read_marker_set("plug-in-gait")
    points = {f"{name}_{side}": np.zeros(3) for name in ("thigh_wand", "shank_wand") for side in "rl"}
    points |= dict.fromkeys(("psis_r", "psis_l"), np.zeros(3))
    found = find_landmarks(recording(standing_positions()), plug_in)
    known = type(found)({}, points, {"knee_r": 0.1, "ankle_r": 0.07, "ankle_l": 0.07}, plug_in)
    assert known.width("knee_l") == 0.1
    (assumption,) = assumptions(known)
    assert (assumption.part, assumption.lacking, assumption.instead) == (
        "knee_l",
        ("knee_l_width",),
        "that of the right knee is used",
    )


ACROMIA = ("R.Acromium", "L.Acromium")


@pytest.fixture(scope="module")
def skeleton():
    """With temples and crown, as they stand, and C7 and two more on the trunk."""
    skeleton = generic_model().skeleton
    shoulder = next(joint.translation[1] for joint in skeleton.joints if joint.child == "upper_arm_r")
    trunk = [m for m in skeleton.markers if m.segment != "torso" or m.label in ("Sternum", *ACROMIA)]
    heights = {"C7": 0.1, "T10": -0.2, "Back": -0.1, "LHD": 0.22, "RHD": 0.23, "Top": 0.36}
    more = [Marker(label, "torso", np.array([0.0, shoulder + height, 0.0])) for label, height in heights.items()]
    return skeleton.with_markers([*trunk, *more])


def test_a_head_is_far_above_the_shoulders(skeleton):
    assert head_markers(skeleton) == ("LHD", "RHD", "Top")
    bare = skeleton.with_markers([m for m in skeleton.markers if m.label not in ("LHD", "RHD", "Top")])
    assert head_markers(bare) == ()
    assert without_head(bare, ACROMIA, bare.labels) == (bare, ())


def test_a_head_is_left_out_where_others_show_the_trunk(skeleton):
    left, head = without_head(skeleton, ACROMIA, skeleton.labels)
    assert head == ("LHD", "RHD", "Top")
    assert set(left.labels) == set(skeleton.labels) - set(head)


def test_a_head_is_needed_beside_acromia_or_where_a_trial_lacks_markers(skeleton):
    worn = set(skeleton.labels) - {"T10", "Back"}
    assert without_head(skeleton, ACROMIA, worn) == (skeleton, ())
    assert without_head(skeleton, (*ACROMIA, "C7", "T10"), skeleton.labels) == (skeleton, ())
