"""A static trial whose axes are not those of the walk."""

from dataclasses import replace

import numpy as np
import pytest

from generic_static import recording, standing_positions
from kinertia.findings.finding import Severity
from kinertia.io.opensim.reader import read_osim
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.person import Person
from kinertia.workflow.screening import screen, with_model_spelling, with_upright_static
from refusals import codes

OTHER_AXES = {
    "+Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "-Y": np.diag([1.0, -1.0, -1.0]),
}


@pytest.mark.parametrize("up", OTHER_AXES)
def test_it_is_put_upright_by_its_landmarks(up):
    positions = standing_positions()
    static = recording({label: OTHER_AXES[up] @ at for label, at in positions.items()})
    upright = with_upright_static(Person(Subject(), [], static)).static
    assert codes(upright.findings) == ["F133"]
    assert upright.vertical == up
    np.testing.assert_allclose(upright.markers.positions[0], list(positions.values()), atol=1e-12)


def test_one_that_is_upright_stays():
    person = Person(Subject(), [], recording(standing_positions()))
    assert with_upright_static(person) is person


def spelled(recording, spelling):
    labels = tuple(spelling(label) for label in recording.markers.labels)
    return replace(recording, markers=replace(recording.markers, labels=labels))


def screened(static, walk):
    return screen(Person(Subject(name="anna", mass_kg=72.6, height_m=1.8, sex="male"), (TrialInput(walk),), static))


@pytest.fixture
def person(recording_of):
    return recording_of("synthetic/static.trc"), recording_of("synthetic/walk.trc", "synthetic/walk_grf.mot")


SPELLINGS = [
    (str, str.lower),
    (str, "Walk_{}".format),
    ("Static_{}".format, str),
    ("Static_{}".format, "Walk_{}".format),
]


@pytest.mark.parametrize(("of_static", "of_walk"), SPELLINGS)
def test_another_spelling_is_read_as_the_static_trials(person, of_static, of_walk):
    static, walk = spelled(person[0], of_static), spelled(person[1], of_walk)
    result = screened(static, walk)
    (trial,) = result.context.trials
    assert trial.recording.markers.labels == tuple(of_static(label) for label in person[1].markers.labels)
    found = [finding for finding in result.findings if finding.code == "L103" and finding.where.trial == walk.name]
    assert {(finding.evidence["written"].value, finding.evidence["label"].value) for finding in found} >= {
        (of_walk(label), of_static(label)) for label in ("R.ASIS", "L.Heel")
    }
    assert max(finding.severity for finding in result.findings) < Severity.ERROR


@pytest.mark.parametrize("of_walk", [str.lower, "Walk_{}".format, lambda label: label.replace(".", " ")])
@pytest.mark.measured
def test_another_spelling_is_read_as_the_models(recording_of, file_of, of_walk):
    walk = recording_of("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot")
    model = read_osim(file_of("gait2354/subject01_scaled.osim"))
    trials = (TrialInput(spelled(walk, of_walk)),)
    result = screen(Person(Subject(name="anna", mass_kg=72.6), trials, model=model))
    read = result.context.trials[0].recording.markers.labels
    assert set(read) & set(model.skeleton.labels) == set(walk.markers.labels) & set(model.skeleton.labels)
    assert max(finding.severity for finding in result.findings) < Severity.ERROR


@pytest.mark.measured
def test_points_that_a_program_calculated_are_left_out_with_a_model(recording_of, file_of):
    """Such as hip centres among the markers of a model's thighs; without a model joints may be placed by them."""
    walk = recording_of("subject4/walking1.trc")
    model = read_osim(file_of("subject4/addbiomechanics_scaled.osim"))
    result = screen(Person(Subject(name="anna", mass_kg=62.6), (TrialInput(walk),), model=model))
    read = result.context.trials[0].recording.markers.labels
    assert set(walk.markers.labels) - set(read) == {"L_HJC", "R_HJC"}
    found = [finding for finding in result.findings if finding.code == "M151"]
    assert [(finding.where.markers, finding.severity) for finding in found] == [
        (("L_HJC",), Severity.CORRECTED),
        (("R_HJC",), Severity.CORRECTED),
    ]


def test_labels_of_another_set_stay_as_they_are(person):
    static, walk = person[0], spelled(person[1], lambda label: f"{len(label)}{label[::-1]}")
    result = screened(static, walk)
    assert result.context.trials[0].recording.markers.labels == walk.markers.labels
    assert "L101" in [finding.code for finding in result.findings]


def test_a_person_whose_labels_fit_keeps_the_marker_set_found(person):
    static, walk = person
    given = Person(Subject(), (TrialInput(walk),), static)
    assert with_model_spelling(given) is given
