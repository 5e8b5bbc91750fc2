"""Trials of a person whose forces are late by another time are named; trials that share a clock never are."""

from dataclasses import replace
from itertools import combinations

import pytest

from command_line import run
from kinertia.diagnostics.timing.trial_delays import TrialDelay, trial_delay, trial_delays_doubts, uneven_delays
from kinertia.io.osim.reader import read_osim
from kinertia.settings import Settings, Subject
from kinertia.trial.sampled_time import within
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.prepare_osim import prepare_osim
from trials_of_people import PEOPLE, Trials

SHOWN = {
    "synthetic": {
        "first": "-0 and -4 ms",
        "late": "+20 and +16 ms) come 20 ms",
        "early": "-21 and -25 ms",
        "later": 21,
        "earlier": "-31 and -35 ms) come 31 ms",
    },
    "subject4": {
        "first": "+7 and +3 ms",
        "late": "+26 and +23 ms) come 20 ms",
        "early": "-14 and -17 ms",
        "later": 20,
        "earlier": "-24 and -27 ms) come 30 ms",
    },
}
"""Delays of the first walk, and of the second with forces 20 ms late, 20 ms early (what the first then is later, ms)
and 30 ms early."""


@pytest.fixture(params=PEOPLE)
def person(request, file_of, recording_of):
    return Trials(PEOPLE[request.param], file_of, recording_of)


@pytest.fixture
def shown(person):
    return SHOWN[person.person.folder]


def late_by(person, *late_s):
    """The first trials of the person, with forces that are late by so much (s), and the labels on each segment."""
    return [person.trial(name, late_s=late) for name, late in zip(person.names, late_s, strict=False)], person.segments


def test_trials_that_share_a_clock(person):
    trials, segments = late_by(person, 0.0, 0.0, 0.0)
    for count in (1, 2, 3):
        for some in combinations(trials, count):
            assert uneven_delays(some, segments) == []


@pytest.mark.parametrize("late_s", [0.02, -0.02, 0.05])
def test_the_delay_is_told(person, late_s):
    for name in person.names:
        first, other = (trial_delay(person.trial(name, late_s=late), person.segments) for late in (0.0, late_s))
        assert other.by_pelvis_s - first.by_pelvis_s == pytest.approx(late_s, abs=0.001)
        assert other.by_centre_s - first.by_centre_s == pytest.approx(late_s, abs=0.001)


def test_one_of_two_is_late(person, shown):
    first, second, _ = person.names
    sound = f"{first} ({shown['first']})"
    (doubt,) = uneven_delays(*late_by(person, 0.0, 0.02))
    assert doubt.startswith(f"the forces of {second} ({shown['late']} later than those of {sound}")
    # which of two is wrong nobody knows
    (doubt,) = uneven_delays(*late_by(person, 0.0, -0.02))
    early = f"{second} ({shown['early']})"
    assert doubt.startswith(f"the forces of {sound} come {shown['later']} ms later than those of {early}")


def test_one_of_three_is_early(person, shown):
    (doubt,) = uneven_delays(*late_by(person, 0.0, -0.03, 0.0))
    early = f"{person.names[1]} ({shown['earlier']}"
    assert doubt.startswith(f"the forces of {early} earlier than those of the other trials")


def test_both_ways_to_tell_have_to_agree():
    first = TrialDelay("a", 0.0, 0.0)
    assert trial_delays_doubts([first, None]) == []
    assert trial_delays_doubts([first, TrialDelay("b", 0.03, 0.01)]) == []
    assert trial_delays_doubts([first, TrialDelay("b", 0.03, -0.03)]) == []
    assert [name for name, _ in trial_delays_doubts([first, TrialDelay("b", 0.02, 0.013)])] == ["b"]


def test_short_windows_tell_longer_delays_only():
    first = TrialDelay("a", 0.0, 0.0)
    for late_s, named in ((0.015, []), (0.02, ["b"])):
        doubts = trial_delays_doubts([first, TrialDelay("b", late_s, late_s, short=True)])
        assert [name for name, _ in doubts] == named


@pytest.mark.parametrize("late_s", [0.0, 0.025, -0.025])
def test_walks_of_less_than_a_second(person, late_s):
    trials, segments = late_by(person, 0.0, late_s)
    short = []
    for trial in trials:
        ((start_s, end_s),) = trial.windows()
        middle_s = (start_s + end_s) / 2
        inside = within(trial.markers.time, middle_s - 0.45, middle_s + 0.45)
        short.append(replace(trial, measured=trial.measured & inside))
    assert all(trial_delay(trial, segments).short for trial in short)
    assert len(uneven_delays(short, segments)) == (late_s != 0.0)


def test_said_by_a_fit(person, file_of):
    model = read_osim(file_of(person.person.model))
    walks = [person.read(*person.person.files(name)) for name in person.names[:2]]
    late = replace(walks[1], plates=replace(walks[1].plates, time=walks[1].plates.time + 0.02))

    def said(*recordings):
        inputs = [TrialInput(one) for one in recordings]
        subject = Subject(mass_kg=person.person.mass_kg)
        warnings = prepare_osim(subject, model, inputs, Settings(), False).warnings
        return [one for one in warnings if "ms later than" in one]

    assert said(*walks) == []
    assert len(said(walks[0], late)) == 1


def test_said_by_check(person, shown, file_of, tmp_path):
    """Of the trial that is late, by its name."""
    trials = ""
    for number, name in enumerate(person.names[:2], start=1):
        markers, forces = (file_of(one) for one in person.person.files(name))
        (tmp_path / forces.name).write_text(later(forces.read_text(), 0.02) if number == 2 else forces.read_text())
        (tmp_path / markers.name).write_text(markers.read_text())
        trials += f'[[trial]]\nname = "{number}. walk"\nmarkers = "{markers.name}"\nforces = "{forces.name}"\n'
    model, mass_kg = file_of(person.person.model).as_posix(), person.person.mass_kg
    (tmp_path / "subject.toml").write_text(f'[subject]\nmass_kg = {mass_kg}\n[model]\nosim = "{model}"\n{trials}')
    said = " ".join(run("check", tmp_path / "subject.toml").out.split())
    assert said.count(f"caution: the forces of 2. walk ({shown['late']} later than those of 1. walk") == 1


def later(text, late_s):
    """The text of a force file with later times."""
    head, rows = text.split("endheader\n", 1)
    labels, *lines = rows.splitlines()
    late = [f"{float(line.split()[0]) + late_s:.6f}\t" + "\t".join(line.split()[1:]) for line in lines]
    return f"{head}endheader\n{labels}\n" + "\n".join(late) + "\n"
