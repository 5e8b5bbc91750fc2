"""Events of a file next to the forces: late ones, those of the other foot, and sound ones."""

from types import SimpleNamespace

import numpy as np
import pytest

from kinertia.diagnostics.timing.file_events import file_events
from kinertia.findings.where import Where
from kinertia.synthetic.walk import walk, walking_subject
from kinertia.trial.data import FEET, FootLoads, Trial
from kinertia.trial.gait_event import FileEvent
from kinertia.trial.gait_events import load_edges


@pytest.fixture(scope="module")
def trial() -> Trial:
    walked = walk(walking_subject(), rate_hz=100.0, duration_s=4.0)
    loads = FootLoads(walked.time, walked.foot_loads[:, :, :3], walked.foot_loads[:, :, 3:])
    return Trial("walk", walked.markers, loads, np.ones(len(walked.time), dtype=bool))


def found(trial, events):
    stated = Trial(trial.name, trial.markers, trial.loads, trial.measured, events=tuple(events))
    return [*file_events(SimpleNamespace(loaded=stated, at=lambda: Where(trial=trial.name)))]


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
    (one,) = found(trial, events)
    assert one.code == "T311"
    assert one.evidence["difference_s"].value == pytest.approx(delay_s)
    assert one.evidence["events"].value == 1
    assert words in one.message


def test_events_of_the_other_foot(trial):
    (one,) = found(trial, of_loads(trial, sides=("l", "r")))
    assert one.code == "T312"


def test_general_events_are_nobody_s_step(trial):
    assert found(trial, [FileEvent(1.0, "", "Left-FP", "", None)]) == []
