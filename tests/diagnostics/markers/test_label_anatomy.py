"""Labels that make no body are found with their cause; those of fault-free trials never are."""

import numpy as np
import pytest

from kinertia.diagnostics.markers.axes_and_floor import unit_and_vertical
from kinertia.diagnostics.markers.label_anatomy import anatomy, direction_of_travel, heading
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Markers
from marker_contexts import codes, context_of, relabelled
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
FAULT_FREE = here([*CLINIC, *CLINIC_STANDING, *PLUG_IN_GAIT, *CLUSTERS_STANDING, *CLUSTERS, RUN])

OUTER_AND_INNER = [*CLINIC_STANDING, *CLUSTERS_STANDING]
"""With markers on both sides of knees and ankles."""
ELBOWS = [*CLUSTERS_STANDING, "synthetic/clusters_walk.trc", RUN]
JOINTS_TOO = [*PLUG_IN_GAIT, *CLUSTERS_STANDING, *CLUSTERS]
PELVIS_AND_FEET = [*JOINTS_TOO, RUN]
"""Two markers at the back of the pelvis, one on the metatarsals of a foot."""
KNEES = [*CLINIC_STANDING, *JOINTS_TOO]
"""With markers at the outer side of knees and ankles."""
SWAPPED = [
    (OUTER_AND_INNER, [("knee_lateral_r", "knee_medial_r")], "L208"),
    (OUTER_AND_INNER, [("knee_lateral_l", "knee_medial_l")], "L208"),
    (OUTER_AND_INNER, [("ankle_lateral_l", "ankle_medial_l")], "L208"),
    (ELBOWS, [("elbow_lateral_r", "elbow_medial_r")], "L208"),
    (ELBOWS, [("elbow_lateral_l", "elbow_medial_l")], "L208"),
    (KNEES, [("knee_lateral_r", "ankle_lateral_r")], "L206"),
    (OUTER_AND_INNER, [("knee_medial_r", "ankle_medial_r")], "L206"),
    (PELVIS_AND_FEET, [("heel_r", "metatarsal_r")], "L205"),
    (PELVIS_AND_FEET, [("asis_r", "psis_r"), ("asis_l", "psis_l")], "L203"),
    (PELVIS_AND_FEET, [("asis_r", "psis_r")], "L203"),
    (PELVIS_AND_FEET, [("asis_l", "psis_l")], "L203"),
    (FAULT_FREE, [("asis_r", "asis_l")], "L202"),
    (KNEES, [("knee_lateral_r", "knee_lateral_l")], "L202"),
    (OUTER_AND_INNER, [("knee_medial_r", "knee_medial_l")], "L202"),
    (OUTER_AND_INNER, [("ankle_medial_r", "ankle_medial_l")], "L202"),
    (OUTER_AND_INNER, [("toe_r", "toe_l")], "L202"),
    *((KNEES, [(f"ankle_lateral_{side}", f"heel_{side}")], "L207") for side in "rl"),
    *((JOINTS_TOO, [(f"ankle_lateral_{side}", f"metatarsal_{side}")], "L207") for side in "rl"),
]
WANDS = [
    *((name, f"{side}THI", f"{side}TIB") for name in PLUG_IN_GAIT for side in "RL"),
    *((name, "R.TH2", "R.SH2") for name in [*CLUSTERS_STANDING, *CLUSTERS]),
]


@pytest.fixture
def recorded(request, recording_of):
    """Markers of a fault-free recording, and their set."""
    markers = recording_of(request.param).markers
    return markers, choose_marker_set(markers.labels)


def found(markers, marker_set):
    return list(anatomy(context_of(markers, marker_set)))


def exchanged(markers, marker_set, *pairs):
    """The markers with the labels of these landmarks, of one marker each, exchanged, and the labels."""
    labels = [tuple(marker_set.landmarks[name][0] for name in pair) for pair in pairs]
    assert {label for pair in labels for label in pair} <= set(markers.labels)
    return relabelled(markers, *labels), {label for pair in labels for label in pair}


def of_recordings(table):
    """Rows of a table that begin with the name of a recording, of those that are on this machine."""
    return [row for row in table if is_here(row[0])]


@pytest.mark.parametrize("recorded", FAULT_FREE, indirect=True)
def test_fault_free_trials(recorded):
    context = context_of(*recorded)
    assert [*anatomy(context), *heading(context), *direction_of_travel(context), *unit_and_vertical(context)] == []


@pytest.mark.parametrize("recorded", FAULT_FREE, indirect=True)
def test_a_rotated_person_is_the_same_person(recorded):
    markers, marker_set = recorded
    angle = np.radians(130.0)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    assert found(markers.rotated(turn), marker_set) == []


@pytest.mark.parametrize("recorded", FAULT_FREE, indirect=True)
@pytest.mark.parametrize(("up", "name"), [(2, "Z"), (-2, "-Z"), (0, "X"), (-1, "-Y")])
def test_another_axis_up(recorded, up, name):
    """Arms held out sideways make a person as wide as tall: extents do not decide."""
    markers, marker_set = recorded
    axis, sign = abs(up), -1.0 if up < 0 else 1.0
    turn = {2: [[1, 0, 0], [0, 0, -1], [0, 1, 0]], 0: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], 1: np.diag([-1.0, 1.0, -1.0])}
    to = sign * np.array(turn[axis], dtype=float)
    (finding,) = unit_and_vertical(context_of(markers.rotated(to), marker_set))
    assert (finding.code, finding.severity) == ("M142", Severity.ERROR)
    assert (finding.evidence["up"].value, finding.evidence["expected"].value) == (name, "Y")


@pytest.mark.parametrize("recorded", FAULT_FREE, indirect=True)
@pytest.mark.parametrize("axis", [0, 2])
def test_mirrored_axes(recorded, axis):
    markers, marker_set = recorded
    (finding,) = found(markers.rotated(np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))), marker_set)
    assert (finding.code, finding.where.markers) == ("L201", ())
    assert finding.evidence["cosine"].value < -0.5


@pytest.mark.parametrize(
    ("recorded", "pairs", "code"),
    of_recordings((name, pairs, code) for names, pairs, code in SWAPPED for name in names),
    indirect=["recorded"],
)
def test_swapped_labels(recorded, pairs, code):
    """Nothing else is found with them."""
    markers, marker_set = recorded
    swapped, labels = exchanged(markers, marker_set, *pairs)
    (finding,) = found(swapped, marker_set)
    assert (finding.code, finding.severity) == (code, Severity.ERROR)
    assert labels <= set(finding.where.markers)


@pytest.mark.parametrize("recorded", here(CLUSTERS_STANDING), indirect=True)
def test_independent_swaps_are_all_found(recorded):
    markers, marker_set = recorded
    pairs = [(f"{joint}_lateral_{side}", f"{joint}_medial_{side}") for joint, side in (("knee", "r"), ("ankle", "l"))]
    swapped, _ = exchanged(markers, marker_set, *pairs, ("heel_r", "metatarsal_r"))
    assert codes(found(swapped, marker_set)) == ["L205", "L208", "L208"]


@pytest.mark.parametrize(("recorded", "thigh", "shank"), of_recordings(WANDS), indirect=["recorded"])
def test_a_wand_of_the_thigh_and_one_of_the_shank_swapped_in_every_file(recorded, thigh, shank):
    markers, marker_set = recorded
    assert {thigh, shank} <= set(markers.labels)
    (finding,) = found(relabelled(markers, (thigh, shank)), marker_set)
    assert finding.code == "L206"
    assert finding.where.markers[0] == thigh


@pytest.mark.parametrize("recorded", here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d"]), indirect=True)
def test_the_way_of_a_walk_confirms_a_single_heading(recorded):
    """Without feet, the pelvis shows where its own front is."""
    markers, marker_set = recorded
    without = markers.select([label for label in markers.labels if label[1:] not in ("HEE", "TOE")])
    assert found(without, marker_set) == []
    swapped, _ = exchanged(without, marker_set, ("asis_r", "asis_l"))
    assert codes(found(swapped, marker_set)) == ["L202"]


@pytest.mark.parametrize(
    "recorded",
    here(["pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_b_walk.c3d", "pig_c3d/subject_b_static.c3d"]),
    indirect=True,
)
def test_left_and_right_of_the_head_swapped(recorded):
    """A head may turn, but not as far: it is named, and others show the trunk."""
    markers, marker_set = recorded
    swapped = relabelled(relabelled(markers, ("LFHD", "RFHD")), ("LBHD", "RBHD"))
    said = found(swapped, marker_set)
    assert [(finding.code, finding.severity) for finding in said] == [("L202", Severity.WARNING)] * 2
    assert {label for finding in said for label in finding.where.markers} == {"LFHD", "RFHD", "LBHD", "RBHD"}


@pytest.mark.parametrize("recorded", FAULT_FREE, indirect=True)
def test_who_walks_backwards(recorded):
    """It is a remark, and no talk of labels that feet and pelvis have shown to be right (D19)."""
    markers, marker_set = recorded
    assert not context_of(markers, marker_set).walks_backwards
    backwards = Markers(markers.time, markers.labels, markers.positions[::-1])
    goes = np.linalg.norm(np.nanmedian(markers.positions[-1] - markers.positions[0], axis=0)[[0, 2]]) > 0.5
    assert context_of(backwards, marker_set).walks_backwards == goes
    said = list(direction_of_travel(context_of(backwards, marker_set)))
    assert [(finding.code, finding.severity, finding.causes) for finding in said] == (
        [("S311", Severity.INFO, ("walking backwards",))] if goes else []
    )


@pytest.mark.parametrize("recorded", here(["synthetic/walk.c3d"]), indirect=True)
def test_heading_is_unknown(recorded):
    markers, marker_set = recorded
    right = marker_set.landmarks["asis_r"][0]
    places = markers.positions.copy()
    places[:, markers.labels.index(right)] = np.nan
    hidden = Markers(markers.time, markers.labels, places)
    absent = markers.select([label for label in markers.labels if label != right])
    for changed, count in ((hidden, 0.0), (absent, 1.0)):
        (finding,) = heading(context_of(changed, marker_set))
        assert (finding.code, finding.evidence["absent"].value) == ("L106", count)
