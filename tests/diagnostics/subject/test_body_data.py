"""What is stated, what files have, and which markers are not there."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.markers.trajectories import absent_markers
from kinertia.diagnostics.subject.body_data import population, stated_and_filed, unobserved_segments
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.recording import read_recording
from kinertia.model.gait27 import ARM_COORDINATES, VIRTUAL_TRUNK
from kinertia.settings import Subject
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers, Recording
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.estimate import estimate
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare
from people import person
from recordings import WALKS

MARKERS = Markers(np.array([0.0, 0.1]), ("A",), np.zeros((2, 1, 3)))


STATIC = Recording("static", MARKERS, mass_kg=60.0, height_m=1.7)


@pytest.mark.parametrize(("mass_kg", "trials"), [(60.5, []), (61.0, ["static"]), (59.0, ["static"])])
def test_a_stated_mass_that_a_file_contradicts(mass_kg, trials):
    found = list(stated_and_filed(person(static=STATIC, mass_kg=mass_kg, height_m=1.7)))
    assert [finding.where.trial for finding in found] == trials
    for finding in found:
        assert (finding.code, finding.where.part) == ("S103", "mass")
        assert (finding.evidence["stated"].value, finding.evidence["filed"].value) == (mass_kg, 60.0)


def test_files_that_contradict_each_other():
    other = replace(STATIC, name="second", mass_kg=66.0)
    (found,) = stated_and_filed(person([other], STATIC, mass_kg=60.0, height_m=1.7))
    assert found.where.trial == "second"


def test_files_that_agree_are_one_finding():
    (found,) = stated_and_filed(person([replace(STATIC, name="second")], STATIC, mass_kg=66.0, height_m=1.7))
    assert (found.where.trial, found.evidence["files"].value) == (None, "static, second")


@pytest.mark.parametrize(
    ("stated_kg", "filed_kg", "severity"), [(72.6, 75.0, "INFO"), (75.0, 72.6, "WARNING"), (90.0, 95.0, "WARNING")]
)
def test_plates_that_confirm_the_stated_mass(recording_of, stated_kg, filed_kg, severity):
    """Whoever corrects a mass as S111 asks is not accused of the old one in the file."""
    walk = replace(recording_of(*WALKS["synthetic"]), mass_kg=filed_kg)
    marker_set = choose_marker_set(walk.markers.labels)
    (found,) = stated_and_filed(person([walk], None, marker_set, mass_kg=stated_kg))
    assert (found.code, found.severity.name) == ("S103", severity)


def test_a_population_that_the_tables_do_not_describe():
    assert list(population(person(mass_kg=70.0, height_m=1.75))) == []
    (found,) = population(person(mass_kg=110.0, height_m=1.75))
    assert (found.code, found.severity.name, found.evidence["population"].value) == ("S401", "WARNING", "obese")
    (found,) = population(person(mass_kg=110.0, height_m=1.75, population="obese"))
    assert found.severity.name == "INFO"


def test_markers_that_a_trial_lacks(recording_of):
    static, walk = recording_of("synthetic/static.trc"), recording_of("synthetic/walk.trc")
    marker_set = choose_marker_set(static.markers.labels)
    lost = walk.markers.labels[3]
    fewer = replace(walk, markers=walk.markers.select([label for label in walk.markers.labels if label != lost]))
    (whole,), (lacking,) = (
        list(absent_markers(person([recording], static, marker_set))) for recording in (walk, fewer)
    )
    assert lacking.code == whole.code == "M105"
    assert set(lacking.where.markers) - set(whole.where.markers) == {lost}


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
        recording, markers=recording.markers.select([label for label in recording.markers.labels if label not in gone])
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
    assert [(finding.code, finding.where.part) for finding in unobserved_segments(skeleton)] == [
        ("R401", part) for part in parts
    ]


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
        ready = prepare(
            Person(RAJAGOPAL, [TrialInput(lacking(trial, gone))], lacking(static, gone), marker_set=marker_set)
        )
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
