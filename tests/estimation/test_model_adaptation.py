"""Arms and trunk of a run whose static trial is a T-pose, with the built-in model."""

from types import SimpleNamespace

import numpy as np
import pytest

import kinertia
from generic_static import generic_model, smooth_motion
from kinertia.estimation import calibration
from kinertia.estimation.calibration import AdaptationInputs, first_poses
from kinertia.estimation.model_adaptation import show_knee_axes, with_rotating_arms
from kinertia.model.gait27 import ARM_ROTATIONS, KNEES, UPPER_ARM_ROTATIONS
from kinertia.trial.data import FootLoads, Markers, Trial

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


@pytest.fixture(scope="module")
def skeleton():
    """With one marker at each elbow and one at each wrist."""
    whole = generic_model().skeleton
    return whole.with_markers([m for m in whole.markers if not m.label.endswith((".Bicep", ".Wrist.Med"))])


def jump(skeleton, elbows_rad=(0.6, 1.6), rotation_rad=1.2, hidden=False) -> Trial:
    """Both arms swing overhead and rotate, with elbows that bend between two angles; a wrist may be hidden for long."""
    free = skeleton.free(UPPER_ARM_ROTATIONS)
    time, motion = smooth_motion(free, 300, 100.0, 0)
    q, phase = motion.q.copy(), 2.0 * np.pi * time
    for side in "rl":
        for name, angle in (
            ("arm_flex", 0.5 + 2.0 * np.sin(phase)),
            ("arm_add", -0.4 + np.sin(2.0 * phase)),
            ("arm_rot", rotation_rad * np.cos(phase)),
            ("elbow_flex", np.mean(elbows_rad) + 0.5 * np.ptp(elbows_rad) * np.sin(phase + 1.0)),
        ):
            q[:, free.coordinates.index(f"{name}_{side}")] = angle
    positions = free.marker_positions(free.pose(q))
    if hidden:
        positions[100:200, free.labels.index("R.Wrist.Lat")] = np.nan
    zero = np.zeros((len(time), 2, 3))
    return Trial("jump", Markers(time, free.labels, positions), FootLoads(time, zero, zero), np.ones(len(time), bool))


def test_arms_rotate_where_bent_elbows_show_it(skeleton):
    trial = jump(skeleton)
    rotating = with_rotating_arms(skeleton, [trial])
    assert set(UPPER_ARM_ROTATIONS) <= set(rotating.coordinates)
    before, after = (first_poses(candidate, [trial])[0].marker_rms_m for candidate in (skeleton, rotating))
    assert before > 0.015
    assert after < 0.001


def test_arms_of_which_a_frame_does_not_show_it_stay_locked(skeleton):
    assert with_rotating_arms(skeleton, [jump(skeleton, (0.0, 0.0))]).coordinates == skeleton.coordinates
    one_sided = with_rotating_arms(skeleton, [jump(skeleton), jump(skeleton, hidden=True)])
    assert "arm_rot_l" in one_sided.coordinates
    assert "arm_rot_r" in one_sided.locked


@pytest.mark.parametrize("rotation_rad", [1.2, 2.0])
def test_adaptation_to_arms_that_the_model_cannot_follow_never_makes_it_worse(skeleton, rotation_rad):
    trial = jump(skeleton, rotation_rad=rotation_rad)
    poses = first_poses(skeleton, [trial])
    sd = {segment: 0.04 if "arm" in segment or segment == "torso" else 0.01 for segment in skeleton.segments}
    adapted = calibration.adapt(
        skeleton, AdaptationInputs([trial], poses, sd, dict.fromkeys(ARM_ROTATIONS, 1.0))
    ).skeleton
    (after,) = first_poses(adapted, [trial])
    assert after.marker_rms_m < poses[0].marker_rms_m


def poses(right_deg, left_deg):
    swing = 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, 101))
    return SimpleNamespace(coordinates=KNEES, q=np.radians(np.outer(swing, [right_deg, left_deg])))


WALK, SQUAT, STANDING = poses(60.0, 58.0), poses(100.0, 95.0), poses(3.0, 2.0)


@pytest.mark.parametrize(
    ("trials", "shown"),
    [
        ([WALK], False),
        ([WALK, STANDING], False),
        ([WALK, WALK], True),
        ([SQUAT], True),
        ([WALK, poses(60.0, 5.0)], False),
        ([SimpleNamespace(coordinates=(), q=np.empty((9, 0)))], False),
    ],
)
def test_what_shows_the_axes(trials, shown):
    assert show_knee_axes(trials) is shown


def test_frames_without_a_pose_and_single_frames_do_not_count():
    trial = poses(20.0, 20.0)
    trial.q[5] = np.nan
    trial.q[50] = np.pi
    assert not show_knee_axes([trial, trial])
