"""Arms and trunk of a run whose static trial is a T-pose, with the built-in model."""

import numpy as np
import pytest

import kinertia

SUBJECT = """
[subject]
name = "run"
sex = "male"
mass_kg = 72.8
height_m = 1.80
[model]
static = "{folder}/subject02_static.trc"
[[trial]]
markers = "{folder}/subject02_running.trc"
forces = "{folder}/subject02_running_grf.mot"
loads = "{folder}/External_Loads.xml"
"""


def heading_deg(rightwards):
    return np.degrees(np.arctan2(-rightwards[:, 0], rightwards[:, 2]))


@pytest.mark.slow
def test_elbows_bend_forwards_and_the_trunk_faces_where_its_markers_do(measured_folder, tmp_path):
    path = tmp_path / "subject.toml"
    path.write_text(SUBJECT.format(folder=(measured_folder / "field" / "hamner_run").as_posix()), encoding="utf-8")
    ready = kinertia.prepare_subject(path)
    (kinematics,) = ready.kinematics
    assert ready.elbow_rotations_rad
    assert ready.torso_rotation_rad > 0.25
    names, q = ready.skeleton.coordinates, kinematics.motion.q
    for side in "rl":
        assert np.median(q[:, names.index(f"elbow_flex_{side}")]) > np.radians(60)
    torso = ready.skeleton.pose(q).rotation[:, ready.skeleton.segments.index("torso")]
    markers = kinematics.trial.markers
    rhs, left = (markers.positions[:, markers.labels.index(f"{side}.Acromium")] for side in "RL")
    assert np.nanmean(heading_deg(torso[..., 2])) == pytest.approx(np.nanmean(heading_deg(rhs - left)), abs=5.0)
