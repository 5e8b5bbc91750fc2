import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.subject.task import task_of
from loads_and_feet import context_of
from recordings import is_here, marker_set_for
from walk_on_plates import FEET, walk

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


@pytest.mark.parametrize(("markers", "forces", "task"), [one for one in TASKS if is_here(one[:2])])
def test_the_task_is_found(recording_of, markers, forces, task):
    recording = recording_of(markers, forces)
    assert task_of(RecordingContext(recording, marker_set_for(recording.markers.labels))) == task


def test_one_step_on_a_plate_is_a_walk():
    assert task_of(context_of(walk([("r", 1)]), FEET)) == "walk"


def test_without_knowledge_of_the_feet_no_task_but_walking_is_assumed():
    assert task_of(RecordingContext(walk([("r", 1)]))) == "walk"


def test_a_stated_task_counts():
    assert task_of(context_of(walk([("r", 1)]), FEET, stated_task="turn")) == "turn"
