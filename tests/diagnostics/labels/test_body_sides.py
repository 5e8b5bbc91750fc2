"""Labels that make no body are named with their cause; those of sound trials never are."""

import re

import numpy as np
import pytest

from kinertia.diagnostics.labels.body_sides import sides_trouble, walks_backwards
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from recordings import here, is_here

CLINIC = ["synthetic/walk.trc", "synthetic/run.trc", "gait2354/subject01_walk1.trc"]
"""No markers at knees and ankles, and one at the back of the pelvis."""
CLINIC_STANDING = ["synthetic/static.trc", "gait2354/subject01_static.trc"]
PLUG_IN_GAIT = [
    "synthetic/static.c3d",
    "synthetic/walk.c3d",
    "pig_c3d/subject_a_static.c3d",
    "pig_c3d/subject_a_walk.c3d",
    "pig_c3d/subject_b_static.c3d",
    "pig_c3d/subject_b_walk.c3d",
]
CLUSTERS_STANDING = ["synthetic/clusters_static.trc", "rajagopal_walk/static_walk_1.trc"]
CLUSTERS = ["synthetic/clusters_walk.trc", "rajagopal_walk/motion_capture_walk.trc"]
RUN = "field/rajagopal_run/motion_capture_run.trc"
SOUND = here([*CLINIC, *CLINIC_STANDING, *PLUG_IN_GAIT, *CLUSTERS_STANDING, *CLUSTERS, RUN])

OUTER_AND_INNER = [*CLINIC_STANDING, *CLUSTERS_STANDING]
"""With markers on both sides of knees and ankles."""
ELBOWS = [*CLUSTERS_STANDING, "synthetic/clusters_walk.trc", RUN]
JOINTS_TOO = [*PLUG_IN_GAIT, *CLUSTERS_STANDING, *CLUSTERS]
PELVIS_AND_FEET = [*JOINTS_TOO, RUN]
"""Two markers at the back of the pelvis, one on the metatarsals of a foot."""
KNEES = [*CLINIC_STANDING, *JOINTS_TOO]
"""With markers at the outer side of knees and ankles."""
SWAPPED = [
    (OUTER_AND_INNER, [("knee_lateral_r", "knee_medial_r")], "outer marker of the right knee is on its inner side"),
    (OUTER_AND_INNER, [("knee_lateral_l", "knee_medial_l")], "outer marker of the left knee is on its inner side"),
    (OUTER_AND_INNER, [("ankle_lateral_l", "ankle_medial_l")], "outer marker of the left ankle is on its inner side"),
    (ELBOWS, [("elbow_lateral_r", "elbow_medial_r")], "outer and inner elbow markers of the right arm"),
    (ELBOWS, [("elbow_lateral_l", "elbow_medial_l")], "outer and inner elbow markers of the left arm"),
    (KNEES, [("knee_lateral_r", "ankle_lateral_r")], "their labels look swapped"),
    (PELVIS_AND_FEET, [("heel_r", "metatarsal_r")], "right foot points backwards"),
    (PELVIS_AND_FEET, [("asis_r", "psis_r"), ("asis_l", "psis_l")], "pelvis points backwards"),
    (SOUND, [("asis_r", "asis_l")], "left and right look swapped in the labels"),
    (KNEES, [("knee_lateral_r", "knee_lateral_l")], "left and right look swapped in the labels"),
]
ON_THE_SIDE = [
    *((name, side, "heel", "behind the heel") for name in KNEES for side in "rl"),
    *((name, side, "metatarsal", "beyond the toes") for name in JOINTS_TOO for side in "rl"),
]
WANDS = [
    *((name, f"{side}THI", f"{side}TIB") for name in PLUG_IN_GAIT for side in "RL"),
    *((name, "R.TH2", "R.SH2") for name in [*CLUSTERS_STANDING, *CLUSTERS]),
]


@pytest.fixture
def recorded(request, recording_of):
    """Markers of a sound recording, and their set."""
    markers = recording_of(request.param).markers
    return markers, choose_marker_set(markers.labels)


def exchanged(markers, marker_set, *pairs):
    """The markers with the labels of these landmarks, of one marker each, exchanged."""
    new = {}
    for pair in pairs:
        (one,), (other,) = (marker_set.landmarks[name] for name in pair)
        assert {one, other} <= set(markers.labels)
        new |= {one: other, other: one}
    return Markers(markers.time, tuple(new.get(label, label) for label in markers.labels), markers.positions)


def of_recordings(table):
    """Rows of a table that begin with the name of a recording, of those that are on this machine."""
    return [row for row in table if is_here(row[0])]


@pytest.mark.parametrize("recorded", SOUND, indirect=True)
def test_sound_trials_are_not_doubted(recorded):
    assert sides_trouble(*recorded) == ""


@pytest.mark.parametrize("recorded", SOUND, indirect=True)
def test_a_turned_person_is_the_same_person(recorded):
    markers, marker_set = recorded
    angle = np.radians(130.0)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    assert sides_trouble(Markers(markers.time, markers.labels, markers.positions @ turn.T), marker_set) == ""


@pytest.mark.parametrize("recorded", SOUND, indirect=True)
@pytest.mark.parametrize(("up", "words"), [(2, r"along \+Z"), (-2, "along -Z"), (0, r"along \+X"), (-1, "along -Y")])
def test_another_axis_up(recorded, up, words):
    """Arms held out sideways make a person as wide as tall: extents do not tell."""
    markers, marker_set = recorded
    axis, sign = abs(up), -1.0 if up < 0 else 1.0
    turn = {2: [[1, 0, 0], [0, 0, -1], [0, 1, 0]], 0: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], 1: np.diag([-1.0, 1.0, -1.0])}
    to = sign * np.array(turn[axis], dtype=float)
    trouble = sides_trouble(Markers(markers.time, markers.labels, markers.positions @ to.T), marker_set)
    assert re.search(f"from the feet to the pelvis it goes .* m {words}", trouble)


@pytest.mark.parametrize("recorded", SOUND, indirect=True)
@pytest.mark.parametrize("axis", [0, 2])
def test_mirrored_axes(recorded, axis):
    markers, marker_set = recorded
    mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
    trouble = sides_trouble(Markers(markers.time, markers.labels, markers.positions * mirror), marker_set)
    assert "left and right" in trouble
    assert "all" in trouble
    assert "mirrored" in trouble


@pytest.mark.parametrize(
    ("recorded", "pairs", "words"),
    of_recordings((name, pairs, words) for names, pairs, words in SWAPPED for name in names),
    indirect=["recorded"],
)
def test_swapped_labels(recorded, pairs, words):
    markers, marker_set = recorded
    trouble = sides_trouble(exchanged(markers, marker_set, *pairs), marker_set)
    assert words in trouble
    assert all(label in trouble for label in marker_set.landmarks[pairs[0][0]])
    assert "correct" in trouble


@pytest.mark.parametrize("recorded", here(PELVIS_AND_FEET), indirect=True)
@pytest.mark.parametrize("side", "rl")
def test_front_and_back_of_one_side_of_the_pelvis(recorded, side):
    markers, marker_set = recorded
    wrong = exchanged(markers, marker_set, (f"asis_{side}", f"psis_{side}"))
    word = {"r": "right", "l": "left"}[side]
    assert f"front and back of the pelvis look swapped on the {word} side" in sides_trouble(wrong, marker_set)


@pytest.mark.parametrize(("recorded", "side", "other", "where"), of_recordings(ON_THE_SIDE), indirect=["recorded"])
def test_ankle_and_heel_or_toe_swapped_in_every_file(recorded, side, other, where):
    markers, marker_set = recorded
    trouble = sides_trouble(exchanged(markers, marker_set, (f"ankle_lateral_{side}", f"{other}_{side}")), marker_set)
    assert "look swapped" in trouble
    assert where in trouble


@pytest.mark.parametrize(("recorded", "thigh", "shank"), of_recordings(WANDS), indirect=["recorded"])
def test_a_wand_of_the_thigh_and_one_of_the_shank_swapped_in_every_file(recorded, thigh, shank):
    markers, marker_set = recorded
    assert {thigh, shank} <= set(markers.labels)
    other = {thigh: shank, shank: thigh}
    swapped = Markers(markers.time, tuple(other.get(label, label) for label in markers.labels), markers.positions)
    assert f"{thigh} of the thigh is" in sides_trouble(swapped, marker_set)


@pytest.mark.parametrize("recorded", SOUND, indirect=True)
def test_who_walks_backwards(recorded):
    markers, marker_set = recorded
    assert not walks_backwards(markers, marker_set)
    backwards = Markers(markers.time, markers.labels, markers.positions[::-1])
    goes = np.nanmedian(markers.positions[-1] - markers.positions[0], axis=0)[[0, 2]]
    assert walks_backwards(backwards, marker_set) == (np.linalg.norm(goes) > 0.5)
