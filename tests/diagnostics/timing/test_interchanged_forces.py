"""Exchanged force files of two trials of a person are named; those of sound trials, and late ones, never are."""

from itertools import combinations

import pytest

from kinertia.diagnostics.timing.exchanged_forces import exchanged_forces
from trials_of_people import PEOPLE, Trials


@pytest.fixture(params=PEOPLE)
def person(request, file_of, recording_of):
    return Trials(PEOPLE[request.param], file_of, recording_of)


@pytest.mark.parametrize("late_s", [0.0, 0.02, -0.05])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_sound_and_late_trials(person, count, late_s):
    second = person.names[1]
    for some in combinations(person.names, count):
        trials = [person.trial(name, late_s=late_s if name == second else 0.0) for name in some]
        assert exchanged_forces(trials, person.segments) == []


def test_one_late_and_the_other_early(person):
    first, second, _ = person.names
    for late_s in (0.01, 0.015, -0.01, -0.015):
        trials = [person.trial(first, late_s=-late_s), person.trial(second, late_s=late_s)]
        assert exchanged_forces(trials, person.segments) == []


def test_exchanged_force_files(person):
    first, second, third = person.names
    trials = [person.trial(first, second), person.trial(second, first), person.trial(third)]
    (sentence,) = exchanged_forces(trials, person.segments)
    assert sentence.startswith(f"the forces of {first} and {second} seem to be exchanged")
    assert sentence.endswith("give each trial its own force file")
