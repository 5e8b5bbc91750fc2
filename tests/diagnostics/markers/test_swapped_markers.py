from dataclasses import replace

import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.diagnostics.markers.swapped_markers import labels_by_model
from kinertia.findings.finding import Severity
from kinertia.model.gait27 import build_gait27
from kinertia.trial.data import Markers, Recording
from marker_contexts import codes, relabelled
from recordings import is_here, marker_set_for

TRIALS = {
    "synthetic": ("synthetic/static.trc", "synthetic/walk.trc", 1.803),
    "synthetic_c3d": ("synthetic/static.c3d", "synthetic/walk.c3d", 1.803),
    "synthetic_run": ("synthetic/static.trc", "synthetic/run.trc", 1.803),
    "synthetic_squats": ("synthetic/static.trc", "synthetic/squats.trc", 1.803),
    "gait2354": ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc", 1.803),
    "rajagopal": ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc", 1.83),
    "pig_a": ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d", 1.61),
    "pig_b": ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d", 1.505),
    "subject4_walk1": ("subject4/static1.trc", "subject4/walking1.trc", 1.7),
    "subject4_walk2": ("subject4/static1.trc", "subject4/walking2.trc", 1.7),
    "subject4_squats": ("subject4/static1.trc", "subject4/squats1.trc", 1.7),
}
WALKS = {name: trial for name, trial in TRIALS.items() if is_here(trial[:2])}
CLINIC = [
    ("R.Heel", "L.Heel"),
    ("R.ASIS", "L.ASIS"),
    ("R.Shank.Upper", "R.Shank.Front"),
    ("R.Shank.Upper", "L.Shank.Upper"),
    ("Sternum", "R.Acromium"),
    ("R.Heel", "R.Toe.Tip"),
]
PLUG_IN_GAIT = [
    *[("RKNE", "LKNE"), ("RASI", "LASI"), ("RHEE", "RTOE"), ("C7", "CLAV"), ("RTHI", "RKNE")],
    *[("RHEE", "LHEE"), ("RKNE", "RANK"), ("RPSI", "LPSI"), ("RTIB", "LTIB"), ("RELB", "LELB")],
]
SWAPS = {
    "synthetic": CLINIC,
    "synthetic_c3d": PLUG_IN_GAIT,
    "synthetic_run": CLINIC,
    "gait2354": CLINIC,
    "rajagopal": [
        ("R.ASIS", "L.ASIS"),
        ("R.Knee", "R.Ankle"),
        ("L.TH1", "L.TH3"),
        ("R.SH1", "R.SH3"),
        ("R.Clavicle", "L.Clavicle"),
    ],
    "pig_a": PLUG_IN_GAIT[:5],
    "pig_b": PLUG_IN_GAIT[5:],
    "subject4_walk1": [("r.ASIS", "L.ASIS"), ("r_sh3", "r_sh4"), ("R_Sternum", "L_Sternum")],
}


@pytest.fixture(scope="module")
def walk(recording_of):
    known = {}

    def read(name):
        if name not in known:
            static_path, walk_path, height = WALKS[name]
            static = recording_of(static_path)
            marker_set = marker_set_for(static.markers.labels)
            skeleton = build_gait27(static, marker_set, height, "male").skeleton
            known[name] = skeleton, recording_of(walk_path).markers
        return known[name]

    return read


def found(skeleton, markers):
    return list(labels_by_model(skeleton, Recording("walk", markers, None)))


@pytest.mark.parametrize("name", WALKS)
def test_fault_free_trials(walk, name):
    assert found(*walk(name)) == []


@pytest.mark.parametrize(
    ("name", "pair"), [(name, pair) for name, pairs in SWAPS.items() if name in WALKS for pair in pairs]
)
def test_swapped_labels(walk, name, pair):
    skeleton, markers = walk(name)
    (finding,) = found(skeleton, relabelled(markers, pair))
    assert (finding.code, finding.severity, finding.where.trial) == ("L212", Severity.ERROR, "walk")
    assert set(finding.where.markers) == set(pair)
    assert finding.evidence["after_m"].value < 0.55 * finding.evidence["before_m"].value


@pytest.fixture(scope="module")
def made():
    skeleton = generic_model().skeleton
    time, motion = smooth_motion(skeleton, n=20, rate_hz=10.0)
    return skeleton, Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(motion.q)))


def test_made_markers(made):
    skeleton, markers = made
    assert found(skeleton, markers) == []
    (finding,) = found(skeleton, relabelled(markers, ("R.Knee.Lat", "L.Knee.Lat")))
    assert (finding.code, set(finding.where.markers)) == ("L212", {"R.Knee.Lat", "L.Knee.Lat"})


def test_another_unit_is_no_swap(made):
    skeleton, markers = made
    (finding,) = found(skeleton, replace(markers, positions=markers.positions / 0.0254 * 0.1))
    assert finding.code == "R106"
    assert finding.evidence["rms_m"].value > 0.08


def test_arms_never_shown_do_not_hinder(made):
    skeleton, markers = made
    arm = [m.label for m in skeleton.markers if m.segment in ("upper_arm_r", "forearm_r")]
    bare = markers.select([label for label in markers.labels if label not in arm])
    assert found(skeleton, bare) == []
    swapped = found(skeleton, relabelled(bare, ("L.Heel", "R.Heel")))
    assert codes(swapped) == ["L212"]


def test_no_complete_frame(made):
    skeleton, markers = made
    positions = markers.positions.copy()
    for frames, segment in ((slice(0, 12), "foot_r"), (slice(8, 20), "forearm_l")):
        columns = [i for i, m in enumerate(skeleton.markers) if m.segment == segment]
        positions[frames, columns] = np.nan
    (finding,) = found(skeleton, Markers(markers.time, markers.labels, positions))
    assert (finding.code, finding.where.part) == ("R103", "ankle_angle_r")


def test_straight_elbows_hide_no_frame(made):
    """With one marker at a straight elbow no frame shows how far the arm has turned about itself, and none needs to."""
    skeleton, markers = made
    _, motion = smooth_motion(skeleton, n=20, rate_hz=10.0)
    motion.q[:, [skeleton.coordinates.index(f"elbow_flex_{side}") for side in "rl"]] = 0.0
    straight = replace(markers, positions=skeleton.marker_positions(skeleton.pose(motion.q)))
    few = straight.select([label for label in markers.labels if not label.endswith("Bicep")])
    assert found(skeleton, few) == []
    (finding,) = found(skeleton, relabelled(few, ("L.Heel", "R.Heel")))
    assert finding.code == "L212"
