from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.movements import InformativeMovements, informative_movements
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.synthetic.motions import MOTIONS
from kinertia.synthetic.walk import walking_subject
from kinertia.trial.data import Markers
from people import person


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
    assert {name for name, each in movements.items() if each.sways} == {"trunk sway", "squat"}
    assert {name for name, each in movements.items() if each.squats} == {"squat"}


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
        assert [one.evidence["movements"].value for one in found] == lacking
        assert {one.code for one in found} <= {"S312"}


def test_a_gap_of_one_marker_is_no_sway():
    time = np.arange(10) / 100.0
    positions = np.zeros((10, 3, 3))
    positions[:, 1:, 1] = 0.5
    positions[:, 2, 0] = 0.3
    positions[4, 2] = np.nan
    moves = InformativeMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["T1", "T2", "not worn"])
    assert (moves.trunk_lean_rad, moves.drop_m) == (pytest.approx(0.0, abs=1e-5), 0.0)
    assert InformativeMovements.of(Markers(time, ("P", "T1", "T2"), positions), ["P"], ["X"]) is None
