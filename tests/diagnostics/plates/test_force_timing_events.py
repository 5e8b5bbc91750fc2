"""Events of a file next to the forces: late ones, those of the other foot, and sound ones."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.evidence.foot_trajectories import foot_trajectories
from kinertia.diagnostics.plates.force_timing import file_events
from kinertia.findings.quantity import Where
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FEET, FootLoads, Trial
from kinertia.trial.file_contents import FileEvent
from kinertia.trial.stances import load_edges

FOOT_MARKERS = {
    side: [marker.label for marker in walking_subject().skeleton.markers if marker.segment == f"foot_{side}"]
    for side in FEET
}


@pytest.fixture(scope="module")
def trial() -> Trial:
    walked = walk(walking_subject(), rate_hz=100.0, duration_s=4.0)
    loads = FootLoads(walked.time, walked.foot_loads[:, :, :3], walked.foot_loads[:, :, 3:])
    return Trial("walk", walked.markers, loads, np.ones(len(walked.time), dtype=bool))


def found(trial, events, feet=None):
    stated = Trial(trial.name, trial.markers, trial.loads, trial.measured, events=tuple(events))
    return [*file_events(SimpleNamespace(loaded=stated, at=lambda: Where(trial=trial.name), foot_trajectories=feet))]


def of_loads(trial, delay_s=0.0, sides=FEET):
    side = dict(zip(FEET, sides, strict=True))
    return [FileEvent(e.time_s + delay_s, side[e.side], "Foot Strike", "", e.kind) for e in load_edges(trial.loads)]


def test_events_with_their_forces(trial):
    assert found(trial, []) == found(trial, of_loads(trial)) == found(trial, of_loads(trial, 0.025)) == []


@pytest.mark.parametrize(
    ("delay_s", "words"), [(-0.06, "is 60 ms before its force"), (0.04, "is 40 ms after its force")]
)
def test_one_event_that_is_off(trial, delay_s, words):
    events = of_loads(trial)
    events[3] = FileEvent(events[3].time_s + delay_s, events[3].side, "Foot Off", "", events[3].kind)
    (finding,) = found(trial, events)
    assert finding.code == "T311"
    assert finding.evidence["difference_s"].value == pytest.approx(delay_s)
    assert finding.evidence["events"].value == 1
    assert words in finding.message


def test_events_of_the_other_foot(trial):
    (finding,) = found(trial, of_loads(trial, sides=("l", "r")))
    assert finding.code == "T312"


@pytest.mark.parametrize("sides", [FEET, ("l", "r")])
def test_times_that_count_from_the_first_frame_of_a_cropped_file(trial, sides):
    """Half a cycle off, they come at the times of the other foot."""
    starts = [e.time_s for e in load_edges(trial.loads) if e.kind == "heel strike"]
    cut = trial.markers.time >= starts[1] - starts[0]
    first_s = float(trial.markers.time[cut][0])
    markers = replace(trial.markers, time=trial.markers.time[cut], positions=trial.markers.positions[cut])
    cropped = replace(trial, markers=markers, measured=trial.measured[cut])
    codes = [finding.code for finding in found(cropped, of_loads(trial, -first_s, sides))]
    assert codes == (["T314"] if sides == FEET else [])
    assert [finding.code for finding in found(cropped, of_loads(trial))] == []


def unloaded(trial):
    """The same walk where no plate is."""
    return replace(trial, loads=replace(trial.loads, force=0.0 * trial.loads.force))


@pytest.mark.parametrize("on_plates", [True, False])
def test_one_event_of_the_other_foot(trial, on_plates):
    feet = foot_trajectories(trial.markers, {side: FOOT_MARKERS[side] for side in FEET})
    events = of_loads(trial)
    measured = trial if on_plates else unloaded(trial)
    assert found(measured, events, feet) == []
    events[3] = replace(events[3], side="l" if events[3].side == "r" else "r")
    (finding,) = found(measured, events, feet)
    assert finding.code == "T313"
    assert finding.evidence["time_s"].value == events[3].time_s
    assert finding.evidence["other_foot"].value != finding.evidence["foot"].value


def test_general_events_are_nobody_s_step(trial):
    assert found(trial, [FileEvent(1.0, "", "Left-FP", "", None)]) == []
