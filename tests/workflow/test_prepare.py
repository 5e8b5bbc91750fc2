"""What preparing shows beside screening reaches the findings; a trial that is left out moves nothing."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.findings.finding import Severity, finding
from kinertia.findings.where import Where
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow import prepare as module
from kinertia.workflow.prepare import prepare


@pytest.fixture
def recordings(recording_of):
    """The static trial and the walk of the synthetic laboratory."""
    return (recording_of(f"synthetic/{kind}.c3d") for kind in ("static", "walk"))


def prepared_from(static, *inputs):
    return prepare(Subject(name="A", sex="male"), static, inputs)


def test_a_trial_that_its_labels_block_does_not_move_the_model(recordings, monkeypatch):
    static, walk = recordings
    walk = replace(walk, name="walk")
    moved = walk.markers.positions + np.where(np.array(walk.markers.labels) == "RKNE", 0.02, 0.0)[:, None]
    other = replace(walk, name="other", markers=replace(walk.markers, positions=moved))
    alone = prepared_from(static, TrialInput(walk, (1.2, 1.8)))

    def blocked(skeleton, trial):
        return [finding("L212", Where(trial=trial.name, markers=("RKNE", "LKNE")))] if trial.name == "other" else []

    monkeypatch.setattr(module, "labels_by_model", blocked)
    both = prepared_from(static, TrialInput(walk, (1.2, 1.8)), TrialInput(other, (1.2, 1.8)))
    assert both.left_out == ("other",)
    np.testing.assert_array_equal(both.skeleton.marker_locals, alone.skeleton.marker_locals)


def test_markers_that_calibration_moves_far_are_reported(recordings):
    static, walk = recordings
    positions = static.markers.positions + np.where(np.array(static.markers.labels) == "RSHO", 0.08, 0.0)[:, None]
    raised = replace(static, markers=replace(static.markers, positions=positions))
    ready = prepared_from(raised, TrialInput(walk, (1.2, 1.9)))
    found = {one.where.markers: one for one in ready.findings if one.code == "M173"}
    assert ("RSHO",) in found
    assert found["RSHO",].severity is Severity.INFO
    assert 0.03 < found["RSHO",].evidence["distance_m"].value < 0.14
