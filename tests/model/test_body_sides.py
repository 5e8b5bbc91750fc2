"""Labels that make no body are named with their cause; those of sound trials never are."""

import re

import numpy as np
import pytest

from kinertia.io.marker_set_file import choose_marker_set
from kinertia.model.body_sides import sides_trouble, walks_backwards
from kinertia.trial.data import Markers

SOUND = [
    "gait2354/subject01_static.trc",
    "gait2354/subject01_walk1.trc",
    "rajagopal_walk/static_walk_1.trc",
    "rajagopal_walk/motion_capture_walk.trc",
    "pig_c3d/subject_a_static.c3d",
    "pig_c3d/subject_a_walk.c3d",
    "pig_c3d/subject_b_static.c3d",
    "pig_c3d/subject_b_walk.c3d",
    "field/rajagopal_run/motion_capture_run.trc",
]


@pytest.fixture(params=SOUND)
def recorded(request, recording_of):
    """Markers of a sound recording, and their set."""
    markers = recording_of(request.param).markers
    return markers, choose_marker_set(markers.labels)


def exchanged(markers, marker_set, *pairs):
    """The markers with the labels of these landmarks exchanged; None where one of them is not there."""
    new = {}
    for one, other in pairs:
        labels = (*marker_set.landmarks.get(one, ()), *marker_set.landmarks.get(other, ()))
        if len(labels) != 2 or not set(labels) <= set(markers.labels):
            return None
        new |= {labels[0]: labels[1], labels[1]: labels[0]}
    return Markers(markers.time, tuple(new.get(label, label) for label in markers.labels), markers.positions)


def test_sound_trials_are_not_doubted(recorded):
    assert sides_trouble(*recorded) == ""


def test_a_turned_person_is_the_same_person(recorded):
    markers, marker_set = recorded
    angle = np.radians(130.0)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    assert sides_trouble(Markers(markers.time, markers.labels, markers.positions @ turn.T), marker_set) == ""


@pytest.mark.parametrize(("up", "words"), [(2, r"along \+Z"), (-2, "along -Z"), (0, r"along \+X"), (-1, "along -Y")])
def test_another_axis_up(recorded, up, words):
    """Arms held out sideways make a person as wide as tall: extents do not tell."""
    markers, marker_set = recorded
    axis, sign = abs(up), -1.0 if up < 0 else 1.0
    turn = {2: [[1, 0, 0], [0, 0, -1], [0, 1, 0]], 0: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], 1: np.diag([-1.0, 1.0, -1.0])}
    to = sign * np.array(turn[axis], dtype=float)
    trouble = sides_trouble(Markers(markers.time, markers.labels, markers.positions @ to.T), marker_set)
    assert re.search(f"from the feet to the pelvis it goes .* m {words}", trouble)


@pytest.mark.parametrize("axis", [0, 2])
def test_mirrored_axes(recorded, axis):
    markers, marker_set = recorded
    mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
    trouble = sides_trouble(Markers(markers.time, markers.labels, markers.positions * mirror), marker_set)
    assert "left and right" in trouble
    assert "all" in trouble
    assert "mirrored" in trouble


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ([("knee_lateral_r", "knee_medial_r")], "outer marker of the right knee is on its inner side"),
        ([("knee_lateral_l", "knee_medial_l")], "outer marker of the left knee is on its inner side"),
        ([("ankle_lateral_l", "ankle_medial_l")], "outer marker of the left ankle is on its inner side"),
        ([("elbow_lateral_r", "elbow_medial_r")], "outer and inner elbow markers of the right arm"),
        ([("elbow_lateral_l", "elbow_medial_l")], "outer and inner elbow markers of the left arm"),
        ([("knee_lateral_r", "ankle_lateral_r")], "their labels look swapped"),
        ([("heel_r", "metatarsal_r")], "right foot points backwards"),
        ([("asis_r", "psis_r"), ("asis_l", "psis_l")], "pelvis points backwards"),
        ([("asis_r", "asis_l")], "left and right look swapped in the labels"),
        ([("knee_lateral_r", "knee_lateral_l")], "left and right look swapped in the labels"),
    ],
)
def test_swapped_labels(recorded, pairs, words):
    markers, marker_set = recorded
    swapped = exchanged(markers, marker_set, *pairs)
    if swapped is None:
        pytest.skip("the trial does not have these markers, one label each")
    trouble = sides_trouble(swapped, marker_set)
    assert words in trouble
    assert all(label in trouble for label in marker_set.landmarks[pairs[0][0]])
    assert "correct" in trouble


@pytest.mark.parametrize("side", "rl")
def test_front_and_back_of_one_side_of_the_pelvis(recorded, side):
    markers, marker_set = recorded
    wrong = exchanged(markers, marker_set, (f"asis_{side}", f"psis_{side}"))
    if wrong is None or exchanged(markers, marker_set, ("asis_r", "psis_r"), ("asis_l", "psis_l")) is None:
        pytest.skip("one marker at the back of the pelvis")
    word = {"r": "right", "l": "left"}[side]
    assert f"front and back of the pelvis look swapped on the {word} side" in sides_trouble(wrong, marker_set)


@pytest.mark.parametrize("side", "rl")
@pytest.mark.parametrize(("other", "where"), [("heel", "behind the heel"), ("metatarsal", "beyond the toes")])
def test_ankle_and_heel_or_toe_swapped_in_every_file(recorded, side, other, where):
    markers, marker_set = recorded
    swapped = exchanged(markers, marker_set, (f"ankle_lateral_{side}", f"{other}_{side}"))
    if swapped is None:
        pytest.skip("has no such marker")
    trouble = sides_trouble(swapped, marker_set)
    assert "look swapped" in trouble
    assert where in trouble


@pytest.mark.parametrize(("thigh", "shank"), [("RTHI", "RTIB"), ("LTHI", "LTIB"), ("R.TH2", "R.SH2")])
def test_a_wand_of_the_thigh_and_one_of_the_shank_swapped_in_every_file(recorded, thigh, shank):
    markers, marker_set = recorded
    if not {thigh, shank} <= set(markers.labels):
        pytest.skip("has no such marker")
    other = {thigh: shank, shank: thigh}
    swapped = Markers(markers.time, tuple(other.get(label, label) for label in markers.labels), markers.positions)
    assert f"{thigh} of the thigh is" in sides_trouble(swapped, marker_set)


def test_who_walks_backwards(recorded):
    markers, marker_set = recorded
    assert not walks_backwards(markers, marker_set)
    backwards = Markers(markers.time, markers.labels, markers.positions[::-1])
    goes = np.nanmedian(markers.positions[-1] - markers.positions[0], axis=0)[[0, 2]]
    assert walks_backwards(backwards, marker_set) == (np.linalg.norm(goes) > 0.5)
