"""Interchanged force files of two trials of a person are found; never in fault-free trials, nor in late ones."""

from dataclasses import replace
from itertools import combinations

import pytest

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.registry import TIMING_PERSON_CHECKS
from kinertia.diagnostics.runner import asked, explained
from kinertia.diagnostics.subject.same_session import interchanged_forces
from kinertia.trial.sampled_data import within
from trials_of_people import PEOPLE, Trials


@pytest.fixture(scope="module", params=PEOPLE)
def person(request, file_of, recording_of):
    return Trials(PEOPLE[request.param], file_of, recording_of)


@pytest.mark.parametrize("delay_s", [0.0, 0.02, -0.05])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_fault_free_and_late_trials(person, count, delay_s):
    second = person.names[1]
    for some in combinations(person.names, count):
        trials = [person.context(name, delay_s=delay_s if name == second else 0.0) for name in some]
        assert list(interchanged_forces(person.together(trials))) == []


def test_one_late_and_the_other_early(person):
    first, second, _ = person.names
    for delay_s in (0.01, 0.015, -0.01, -0.015):
        trials = [person.context(first, delay_s=-delay_s), person.context(second, delay_s=delay_s)]
        assert list(interchanged_forces(person.together(trials))) == []


@pytest.mark.parametrize("share", [0.5, 0.6, 0.75])
def test_overlapping_parts_of_one_recording_whose_one_plate_has_a_wrong_gain(person, share):
    """Where they overlap, the other's forces are its own: a shorter window leaves less unexplained."""
    whole = person.context(person.names[0])
    plates = whole.recording.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    force[:, 0] *= 1.08
    moment[:, 0] *= 1.08
    time = whole.recording.markers.time
    start, end, part = time[0], time[-1], share * (time[-1] - time[0])
    parts = []
    for name, (first, last) in {"first": (start, start + part), "second": (end - part, end)}.items():
        inside = within(plates.time, first, last)
        loads = replace(plates, time=plates.time[inside], force=force[inside], moment=moment[inside])
        recording = replace(whole.recording, name=name, markers=whole.recording.markers.cut(first, last), plates=loads)
        parts.append(RecordingContext(recording, person.marker_set))
    assert list(interchanged_forces(person.together(parts))) == []


def test_interchanged_force_files(person):
    first, second, third = person.names
    trials = [person.context(first, second), person.context(second, first), person.context(third)]
    found = list(interchanged_forces(person.together(trials)))
    assert [finding.code for finding in found] == ["S304", "S304"]
    assert [(finding.where.trial, finding.evidence["other_trial"].value) for finding in found] == [
        (first, second),
        (second, first),
    ]
    assert all(finding.evidence["left_crossed"].value < finding.evidence["left_own"].value for finding in found)


def test_an_interchange_does_not_hide_the_delay_of_a_third_trial(person):
    """Chain I of the precedence."""
    first, second, third = person.names
    trials = [person.context(first, second), person.context(second, first), person.context(third, delay_s=0.1)]
    for name in (first, second):
        again = person.context(name)
        trials.append(replace(again, recording=replace(again.recording, name=f"{name} again")))
    found = explained(asked(TIMING_PERSON_CHECKS, person.together(trials)))
    muted = {finding.where.trial: finding.muted_by for finding in found if finding.code == "T213"}
    assert muted[third] is None
    assert {by for name, by in muted.items() if name in (first, second)} <= {"S304"}
