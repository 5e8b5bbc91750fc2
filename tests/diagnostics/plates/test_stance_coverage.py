from dataclasses import replace

import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.plates.stance_coverage import coverage_of, stance_coverage
from kinertia.findings.finding import Severity
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.trial.data import Recording
from loads_and_feet import context_of
from people import person
from recordings import here
from walk_on_plates import FEET, walk


def found(*recordings: Recording):
    """Code, severity, side and phase of what is found in walks."""
    contexts = [context_of(one, FEET) for one in recordings]
    rows = list(stance_coverage(replace(person(), trials=contexts)))
    phases = [one.evidence["phase"].value if "phase" in one.evidence else "" for one in rows]
    return [
        (one.code, one.severity, one.evidence["side"].value, phase) for one, phase in zip(rows, phases, strict=True)
    ]


def until(recording: Recording, end_s: float) -> Recording:
    """The recording with plates that measure nothing after this time."""
    plates = recording.plates
    late = plates.time > end_s
    force, moment = plates.force.copy(), plates.moment.copy()
    force[late] = moment[late] = 0.0
    return replace(recording, plates=replace(plates, force=force, moment=moment))


BOTH = walk([("r", 1), ("l", 1)])
CUT = until(BOTH, 2.1)
"""The left foot stands from 1.7 to 2.3 s."""


def test_two_whole_stances_are_enough():
    assert found(BOTH) == []


def test_a_stance_without_push_off():
    assert found(CUT) == [("P272", Severity.WARNING, "left", "push-off")]


def test_another_walk_has_it():
    assert found(CUT, replace(walk([("l", 1)]), name="walk 2")) == []


def test_a_window_that_the_user_states_is_meant():
    windowed = context_of(CUT, FEET, window_s=(1.2, 1.9))
    assert list(stance_coverage(replace(person(), trials=[windowed]))) == []
    assert found(CUT) != []


def test_a_leg_that_no_plate_measures_is_no_warning():
    assert found(walk([("r", 1)])) == [("P289", Severity.INFO, "left", "")]


def test_recordings_without_strides_have_none(recording_of):
    squats = recording_of("synthetic/squats.trc", "synthetic/squats_grf.mot")
    context = RecordingContext(squats, choose_marker_set(squats.markers.labels))
    assert coverage_of(context) == ()
    assert list(stance_coverage(replace(person(), trials=[context]))) == []


MEASURED = {
    "pig_c3d/subject_a_walk.c3d": [],
    "pig_c3d/subject_b_walk.c3d": [("right", ("loading response", "mid-stance"))],
    "field/biomechzoo/HC030A/straight.c3d": [],
    "field/biomechzoo/HC002D/straight.c3d": [],
    "field/biomechzoo/HC038A/turn.c3d": [("left", ("mid-stance", "push-off"))],
    "field/biomechzoo/HC036A/turn.c3d": [("left", ("loading response", "mid-stance", "push-off"))],
}


@pytest.mark.parametrize("name", here(MEASURED))
def test_measured_walks(recording_of, name):
    recording = recording_of(name)
    legs = coverage_of(RecordingContext(recording, choose_marker_set(recording.markers.labels)))
    assert [(leg.word, leg.missing) for leg in legs if leg.missing] == MEASURED[name]
