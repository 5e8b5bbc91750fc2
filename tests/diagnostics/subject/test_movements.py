from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.subject.movements import InformativeMovements, informative_movements, task_of
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.synthetic.motions import MOTIONS
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers
from loads_and_feet import context_of
from people import person
from recordings import is_here, marker_set_for
from walk_on_plates import FEET, walk


@pytest.fixture(scope="module")
def movements():
    """Of every motion of the package."""
    subject = walking_subject()
    trials = {name: make(subject) for name, make in MOTIONS.items()}
    labels = {
        segment: [marker.label for marker in subject.skeleton.markers if marker.segment == segment]
        for segment in ("pelvis", "torso")
    }
    return {
        name: InformativeMovements.of(trial.markers, labels["pelvis"], labels["torso"])
        for name, trial in trials.items()
    }


def test_each_motion_is_told_by_what_moves(movements):
    assert {name for name, found in movements.items() if found.sways} == {"trunk sway", "squat"}
    assert {name for name, found in movements.items() if found.squats} == {"squat"}


def test_what_is_missing_is_named(recording_of):
    """Of trials with forces."""
    walk, squats = (recording_of(f"synthetic/{name}.trc", f"synthetic/{name}_grf.mot") for name in ("walk", "squats"))
    marker_set = choose_marker_set(walk.markers.labels)
    for trials, lacking in (
        ([walk], ["trunk sway or squats"]),
        ([walk, replace(squats, plates=None)], ["trunk sway or squats"]),
        ([walk, squats], []),
        ([], []),
    ):
        found = list(informative_movements(person(trials, marker_set=marker_set)))
        assert [finding.evidence["movements"].value for finding in found] == lacking
        assert {finding.code for finding in found} <= {"S312"}


def test_a_gap_of_one_marker_is_no_sway():
    time = np.arange(10) / 100.0
    positions = np.zeros((10, 3, 3))
    positions[:, 1:, 1] = 0.5
    positions[:, 2, 0] = 0.3
    positions[4, 2] = np.nan
    moves = InformativeMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["T1", "T2", "not worn"])
    assert (moves.trunk_lean_rad, moves.drop_m) == (pytest.approx(0.0, abs=1e-5), 0.0)
    assert InformativeMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["X"]) is None


TASKS = [
    ("synthetic/walk.trc", "synthetic/walk_grf.mot", "walk"),
    ("synthetic/run.trc", "synthetic/run_grf.mot", "run"),
    ("synthetic/squats.trc", "synthetic/squats_grf.mot", "squat"),
    ("rajagopal_walk/motion_capture_walk.trc", "rajagopal_walk/grf_walk.mot", "walk"),
    ("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot", "walk"),
    ("field/rajagopal_run/motion_capture_run.trc", "field/rajagopal_run/grf_run.mot", "run"),
    ("field/hamner_run/subject02_running.trc", "field/hamner_run/subject02_running_grf.mot", "run"),
    ("field/biomechzoo/HC030A/straight.c3d", None, "walk"),
    ("field/biomechzoo/HC030A/turn.c3d", None, "turn"),
    ("subject4/DJ1.trc", "subject4/DJ1_grf.mot", "landing"),
    ("subject4/squats1.trc", "subject4/squats1_grf.mot", "squat"),
    ("subject4/walkingTS1.trc", "subject4/walkingTS1_grf.mot", "walk"),
]


@pytest.mark.parametrize(("markers", "forces", "task"), [files for files in TASKS if is_here(files[:2])])
def test_the_task_is_found(recording_of, markers, forces, task):
    recording = recording_of(markers, forces)
    assert task_of(RecordingContext(recording, marker_set_for(recording.markers.labels))) == task


def test_one_step_on_a_plate_is_a_walk():
    assert task_of(context_of(walk([("r", 1)]), FEET)) == "walk"


def test_without_knowledge_of_the_feet_no_task_but_walking_is_assumed():
    assert task_of(RecordingContext(walk([("r", 1)]))) == "walk"


def test_a_stated_task_counts():
    assert task_of(context_of(walk([("r", 1)]), FEET, stated_task="turn")) == "turn"
