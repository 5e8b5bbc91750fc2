"""What inverse kinematics of several trials finds, of those that it solves and of those that it cannot."""

from dataclasses import replace

import numpy as np
import pytest

from generic_static import generic_model, smooth_motion
from kinertia.trial.data import FootLoads, Markers, Trial
from kinertia.workflow.person import RotatedTrial, solved_trials

FRAMES, RATE = 101, 100.0


@pytest.fixture(scope="module")
def skeleton():
    return generic_model().skeleton


@pytest.fixture(scope="module")
def trial(skeleton) -> Trial:
    time = np.arange(FRAMES) / RATE
    motion = smooth_motion(skeleton, FRAMES, RATE)[1]
    markers = Markers(time, skeleton.labels, skeleton.marker_positions(skeleton.pose(motion.q)))
    loads = FootLoads(time, np.tile([0.0, 350.0, 0.0], (FRAMES, 2, 1)), np.zeros((FRAMES, 2, 3)))
    return Trial("walk", markers, loads, np.ones(FRAMES, dtype=bool))


def measured_in(trial: Trial, name: str, *spans: tuple[int, int]) -> RotatedTrial:
    measured = np.zeros(FRAMES, dtype=bool)
    for first, last in spans:
        measured[first:last] = True
    return RotatedTrial(replace(trial, name=name, measured=measured))


def test_findings_are_those_of_all_trials(skeleton, trial):
    trials = [measured_in(trial, "parted", (0, 45), (55, FRAMES)), measured_in(trial, "brief", (40, 44))]
    solved = solved_trials(skeleton, trials, 10.0, 0.0, lambda stage, share: None)
    assert [solved_trial.trial.name for solved_trial in solved.kinematics] == ["parted"]
    found = [(finding.code, finding.where.trial) for finding in solved.findings if finding.rule.question != "O31"]
    assert found == [("P270", "parted"), ("P279", "brief")]
