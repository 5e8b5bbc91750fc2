from dataclasses import replace

import numpy as np
import pytest

from kinertia.io.c3d.reader import read_c3d
from kinertia.io.c3d.theia import POSE_SD_M
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.model.gait27 import build_gait27
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.settings import Subject
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare
from refusals import only, refused
from theia_file import plates, write_theia


@pytest.fixture(scope="module")
def person():
    return walking_subject()


@pytest.fixture(scope="module")
def file(person, tmp_path_factory):
    trial = walk(person)
    return trial, write_theia(tmp_path_factory.mktemp("theia") / "walk.c3d", trial)


def test_poses_become_markers_of_a_set_of_their_own(file):
    trial, path = file
    recording = read_c3d(path)
    assert choose_marker_set(recording.markers.labels) == read_marker_set("theia")
    assert set(recording.virtual_sd_m.values()) == {POSE_SD_M}
    assert set(recording.virtual_sd_m) == set(recording.markers.labels)
    np.testing.assert_allclose(np.diff(recording.markers.time), np.diff(trial.time), atol=1e-9)
    assert recording.vertical == "+Z"
    only(recording.findings, "F165", count=len(recording.markers.labels), sd_m=0.01)


def test_the_joint_centres_of_the_model_are_those_of_the_poses(file, person):
    """A model from nothing but the poses of a walk: thighs, shanks and arms as long as the walker's."""
    trial, path = file
    static = read_c3d(path, standing=True)
    assert len(static.markers.time) == 1
    model = build_gait27(static, read_marker_set("theia"), 1.8, "male")
    joints = {joint.child: joint for joint in model.skeleton.joints}
    for theirs in trial.skeleton.joints:
        if theirs.child.startswith(("shank", "forearm", "thigh")):
            mine = np.asarray(joints[theirs.child].translation)
            other = np.asarray(theirs.translation)
            if theirs.child.startswith("thigh"):  # by Bell, from the distance of the hips alone
                mine, other = mine[2], other[2]
            assert mine == pytest.approx(other, abs=0.002), theirs.child


def test_a_pose_that_is_lost_is_a_marker_that_is_missing(file, tmp_path):
    trial, _ = file
    path = write_theia(tmp_path / "walk.c3d", trial, np.nan, np.random.default_rng(0))
    with refused("F164", None):
        read_c3d(path)


def test_a_file_of_the_maker(measured_folder):
    path = measured_folder / "c3d_variety" / "rotations_only.c3d"
    walking, standing = read_c3d(path), read_c3d(path, standing=True)
    assert walking.markers.positions.shape == (340, 36, 3)
    at = dict(zip(standing.markers.labels, standing.markers.positions[0], strict=True))
    thigh = np.linalg.norm(at["pose_hip_r"] - at["pose_shank_r"])
    assert 0.38 < thigh < 0.48
    hip, knee = (walking.markers.select([name]).positions[:, 0] for name in ("pose_hip_r", "pose_shank_r"))
    assert np.nanmedian(np.linalg.norm(hip - knee, axis=1)) == pytest.approx(thigh, abs=0.002)
    across = at["pose_asis_r"] - at["pose_asis_l"]
    forward = np.cross([0.0, 1.0, 0.0], across / np.linalg.norm(across))
    assert 0.15 < (at["pose_metatarsal_r"] - at["pose_heel_r"]) @ forward < 0.25
    assert (at["pose_acromion_r"] - at["pose_acromion_l"]) @ across > 0.0


@pytest.mark.slow
def test_a_walk_of_poses_is_fitted(person, tmp_path):
    """Joint moments of a synthetic walk from its noisy poses, without any static trial."""
    trial = walk(person, 1.6)
    path = write_theia(tmp_path / "walk.c3d", trial, 0.002, np.random.default_rng(1))
    recording = replace(read_c3d(path), plates=plates(trial))
    subject = Subject(name="one", mass_kg=person.bsp.total_mass_kg, height_m=1.8, sex="male")
    fit = estimate(prepare(Person(subject, [TrialInput(recording)], read_c3d(path, standing=True))))
    assert fit.converged
    fitted = fit.trials[0]
    assert np.sqrt(np.square(fitted.residuals["estimate"][:, :3]).sum(axis=1).mean()) < 6.0
    assert np.sqrt(np.nanmean(np.square(fitted.marker_errors_m["final"]))) < 0.02
    true = inverse_dynamics(trial.skeleton, trial.bsp, trial.motion, trial.foot_loads)[fitted.kinematics.frames]
    for name, allowed_nm in {"hip_flexion": 8.0, "knee_angle": 5.0, "ankle_angle": 4.0}.items():
        for side in "rl":
            i, j = (s.coordinates.index(f"{name}_{side}") for s in (fitted.skeleton, trial.skeleton))
            apart = fitted.joint_loads["estimate"][:, i] - true[:, j]
            assert np.sqrt(np.square(apart).mean()) < allowed_nm
