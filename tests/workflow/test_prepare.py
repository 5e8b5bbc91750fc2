"""What preparing shows beside screening reaches the findings; a trial that is left out moves nothing."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import SettingsError
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Where
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow import built_in_model as module
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare


@pytest.fixture
def recordings(recording_of):
    """The static trial and the walk of the synthetic laboratory."""
    return (recording_of(f"synthetic/{kind}.c3d") for kind in ("static", "walk"))


def prepared_from(static, *inputs):
    return prepare(Person(Subject(name="A", sex="male"), inputs, static))


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
    found = {reported.where.markers: reported for reported in ready.findings if reported.code == "M173"}
    assert ("RSHO",) in found
    assert found["RSHO",].severity is Severity.INFO
    assert 0.03 < found["RSHO",].evidence["distance_m"].value < 0.14


def test_a_head_beside_four_markers_of_the_trunk_is_left_out_and_named(recordings):
    static, walk = recordings
    ready = prepared_from(static, TrialInput(walk, (1.2, 1.9)))
    (reported,) = (found_finding for found_finding in ready.findings if found_finding.code == "M174")
    assert set(reported.where.markers) == {"RFHD", "LFHD", "RBHD", "LBHD"}
    assert not set(reported.where.markers) & set(ready.skeleton.labels)
    assert not set(reported.where.markers) & set(ready.kinematics[0].ik.labels)


def test_a_range_that_the_user_states_is_the_models_and_is_named(recordings):
    static, walk = recordings
    subject = Subject(name="A", sex="male", ranges_deg={"knee_angle_r": (-20, 150), "elbow_flex_l": (-12, 150)})
    ready = prepare(Person(subject, [TrialInput(walk, (1.2, 1.9))], static))
    knee, elbow = (ready.skeleton.ranges[name] for name in subject.ranges_deg)
    assert (np.degrees(knee.low), knee.clamped, knee.stated) == (pytest.approx(-20.0), False, True)
    assert (np.degrees(elbow.low), elbow.clamped, elbow.stated) == (pytest.approx(-12.0), True, True)
    assert [reported.where.part for reported in ready.findings if reported.code == "S411"] == [
        "knee_angle_r",
        "elbow_flex_l",
    ]


def test_a_range_of_no_coordinate_is_refused(recordings):
    static, walk = recordings
    subject = Subject(name="A", sex="male", ranges_deg={"knee_r": (-20, 150)})
    with pytest.raises(SettingsError, match="no coordinate knee_r moves; there is knee_angle_r"):
        prepare(Person(subject, [TrialInput(walk, (1.2, 1.9))], static))
