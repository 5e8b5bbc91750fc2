"""Marker sets without arms, or without anything above the pelvis: what the legs' joint moments say of it."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.unobserved_segments import unobserved_segments
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.recording import read_recording
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.settings import Subject
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.prepare import prepare

RAJAGOPAL = Subject(name="one", mass_kg=85.0, height_m=1.83, sex="male")
LEGS = [f"{name}_{side}" for side in "rl" for name in ("hip_flexion", "hip_adduction", "knee_angle", "ankle_angle")]


def without(marker_set, segments):
    """The set without these segments' markers, and their labels."""
    gone = {label for name in segments for label in marker_set.segments[name]}
    kept = {name: labels for name, labels in marker_set.landmarks.items() if not gone & set(labels)}
    worn = {name: tuple(label for label in labels if label not in gone) for name, labels in marker_set.segments.items()}
    return replace(marker_set, landmarks=kept, segments=worn), gone


def lacking(recording, gone):
    return replace(
        recording, markers=recording.markers.select([one for one in recording.markers.labels if one not in gone])
    )


@pytest.mark.parametrize(
    ("locked", "parts"),
    [
        ((), []),
        (ARM_COORDINATES, ["arms"]),
        ([name for name in ARM_COORDINATES if name.endswith("_l")], ["left arm"]),
        (["elbow_flex_r"], ["right forearm"]),
    ],
)
def test_arms_that_no_marker_shows(locked, parts):
    skeleton = walking_subject().skeleton.lock(dict.fromkeys(locked, 0.0))
    assert [(one.code, one.where.part) for one in unobserved_segments(skeleton)] == [("R401", part) for part in parts]


@pytest.fixture(scope="module")
def walk(measured_folder):
    folder = measured_folder / "rajagopal_walk"
    walk = read_recording(folder / "motion_capture_walk.trc", folder / "grf_walk.mot", folder / "grf_walk.xml")
    return read_recording(folder / "static_walk_1.trc"), walk


@pytest.fixture(scope="module")
def fits(walk):
    static, trial = walk
    whole = read_marker_set("rajagopal")
    arms = [name for name in whole.segments if "arm" in name]
    results = {}
    for name, segments in {"all": [], "no arms": arms, "no trunk": [*arms, "torso"]}.items():
        marker_set, gone = without(whole, segments)
        ready = prepare(RAJAGOPAL, lacking(static, gone), [TrialInput(lacking(trial, gone))], None, marker_set)
        results[name] = ready, estimate(ready)
    return results


@pytest.mark.slow
@pytest.mark.parametrize("name", ["no arms", "no trunk"])
def test_joint_moments_of_the_legs_stay_within_their_deviations(fits, name):
    """A measured walk against itself with all its markers."""
    (_, whole), (ready, fit) = fits["all"], fits[name]
    assert fit.converged
    (unobserved,) = unobserved_segments(ready.skeleton)
    assert (unobserved.code, unobserved.where.part) == ("R401", {"no arms": "arms"}.get(name, "trunk, arms and head"))
    full, less = whole.trials[0], fit.trials[0]
    for coordinate in LEGS:
        i, j = (trial.skeleton.coordinates.index(coordinate) for trial in (full, less))
        n = min(len(full.deviations.moments), len(less.deviations.moments))
        apart = np.abs(full.joint_loads["estimate"][:n, i] - less.joint_loads["estimate"][:n, j])
        sd = np.hypot(full.deviations.moments[:n, i], less.deviations.moments[:n, j])
        assert (apart < 2.0 * sd).mean() > 0.95, coordinate
    assert np.sqrt(np.square(less.residuals["estimate"][:, :3]).sum(axis=1).mean()) < 8.0


@pytest.mark.slow
def test_a_trunk_without_markers_is_known_by_the_forces(fits):
    """Its virtual markers give way, and do not count among the marker errors."""
    _, fit = fits["no trunk"]
    trial = fit.trials[0]
    assert set(trial.kinematics.trial.virtual_sd_m) == {marker.label for marker in VIRTUAL_TRUNK}
    at = [trial.kinematics.ik.labels.index(marker.label) for marker in VIRTUAL_TRUNK]
    assert np.isnan(trial.marker_errors_m["final"][:, at]).all()
    assert np.sqrt(np.nanmean(np.square(trial.marker_errors_m["final"]))) < 0.01
    before = np.sqrt(np.square(trial.residuals["literature"][:, :3]).sum(axis=1).mean())
    after = np.sqrt(np.square(trial.residuals["estimate"][:, :3]).sum(axis=1).mean())
    assert after < 0.2 * before
