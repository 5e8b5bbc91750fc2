import numpy as np
import pytest

from kinertia.diagnostics.subject.telling_movements import TellingMovements, missing_movements
from kinertia.synthetic.motions import MOTIONS
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers


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
        name: TellingMovements.of(trial.markers, labels["pelvis"], labels["torso"]) for name, trial in trials.items()
    }


def test_each_motion_is_told_by_what_moves(movements):
    assert {name for name, each in movements.items() if each.sways} == {"trunk sway", "squat"}
    assert {name for name, each in movements.items() if each.squats} == {"squat"}


def test_what_is_missing_is_named(movements):
    assert "a swaying trunk or squats" in missing_movements([movements["walk"], None])
    sentence = missing_movements([movements["walk"], movements["trunk sway"]])
    assert "no trial with squats" in sentence
    assert "trunk" not in sentence
    assert missing_movements([movements["squat"], movements["trunk sway"]]) is None
    assert missing_movements([None]) is None


def test_a_gap_of_one_marker_is_no_sway():
    time = np.arange(10) / 100.0
    positions = np.zeros((10, 3, 3))
    positions[:, 1:, 1] = 0.5
    positions[:, 2, 0] = 0.3
    positions[4, 2] = np.nan
    telling = TellingMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["T1", "T2", "not worn"])
    assert (telling.lean_deg, telling.drop_m) == (pytest.approx(0.0, abs=1e-5), 0.0)
    assert TellingMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["X"]) is None
