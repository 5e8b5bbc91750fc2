"""Trials of a person whose forces are late by another time are found; trials that share a time base never are."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from kinertia.diagnostics.plates.force_timing import TrialDelay, plate_delay, trial_delay, trial_delays, uneven_delays
from plate_findings import context_of
from recordings import WALKS
from trials_of_people import PEOPLE, Trials


@pytest.fixture(scope="module", params=PEOPLE)
def person(request, file_of, recording_of):
    return Trials(PEOPLE[request.param], file_of, recording_of)


def late_by(person, *delay_s):
    """The person with the first trials, whose forces are late by so much (s)."""
    named = zip(person.names, delay_s, strict=False)
    return person.together([person.context(name, delay_s=late) for name, late in named])


def delays_of(findings):
    """Delays (s) by the names of the trials."""
    found = list(findings)
    assert all(finding.code == "T213" for finding in found)
    return {finding.where.trial: finding.evidence["delay_s"].value for finding in found}


def test_trials_that_share_a_time_base(person):
    contexts = late_by(person, 0.0, 0.0, 0.0).trials
    for count in (1, 2, 3):
        for some in combinations(contexts, count):
            assert delays_of(trial_delays(person.together(some))) == {}


@pytest.mark.parametrize("delay_s", [0.02, -0.02, 0.05])
def test_the_delay_is_measured(person, delay_s):
    for name in person.names:
        first, other = (trial_delay(person.context(name, delay_s=late)) for late in (0.0, delay_s))
        assert other.by_pelvis_s - first.by_pelvis_s == pytest.approx(delay_s, abs=0.001)
        assert other.by_markers_s - first.by_markers_s == pytest.approx(delay_s, abs=0.001)


@pytest.mark.parametrize("delay_s", [0.02, -0.02])
def test_of_two_both_are_named(person, delay_s):
    """D11: nobody knows which of them is wrong."""
    first, second, _ = person.names
    found = delays_of(trial_delays(late_by(person, 0.0, delay_s)))
    assert found == pytest.approx({first: -delay_s, second: delay_s}, abs=0.003)


def test_one_of_three_is_early(person):
    found = delays_of(trial_delays(late_by(person, 0.0, -0.03, 0.0)))
    assert found == pytest.approx({person.names[1]: -0.03}, abs=0.005)


def test_both_ways_to_measure_have_to_agree():
    first = TrialDelay("a", 0.0, 0.0)
    for other, names in (
        (None, set()),
        (TrialDelay("b", 0.03, 0.01), set()),
        (TrialDelay("b", 0.03, -0.03), set()),
        (TrialDelay("b", 0.02, 0.013), {"a", "b"}),
    ):
        assert set(delays_of(uneven_delays([first, other]))) == names


def test_short_windows_show_longer_delays_only():
    first = TrialDelay("a", 0.0, 0.0)
    for delay_s, names in ((0.015, set()), (0.02, {"a", "b"})):
        assert set(delays_of(uneven_delays([first, TrialDelay("b", delay_s, delay_s, short=True)]))) == names


@pytest.mark.parametrize("delay_s", [0.0, 0.025, -0.025])
def test_walks_of_less_than_a_second(person, delay_s):
    short = []
    for context in late_by(person, 0.0, delay_s).trials:
        ((start_s, end_s),) = context.trial.windows()
        middle_s = (start_s + end_s) / 2
        short.append(replace(context, window_s=(middle_s - 0.45, middle_s + 0.45)))
    assert all(trial_delay(context).short for context in short)
    assert len(delays_of(trial_delays(person.together(short)))) == (2 if delay_s else 0)


CLEAR = ("synthetic", "synthetic c3d", "gait2354", "rajagopal")
"""Walks in which two plates share the load for long enough."""


@pytest.fixture(params=[name for name in CLEAR if name in WALKS])
def walk(request, recording_of):
    return recording_of(*WALKS[request.param])


def changed(walk, delays_s=(0.0, 0.0), gains=(1.0, 1.0)):
    """Forces of the two plates late by so much, and of another gain."""
    plates = walk.plates
    force, moment = plates.force.copy(), plates.moment.copy()
    for p, (delay_s, gain) in enumerate(zip(delays_s, gains, strict=True)):
        shift = round(delay_s / (plates.time[1] - plates.time[0]))
        rows = np.clip(np.arange(len(plates.time)) - shift, 0, None)
        force[:, p], moment[:, p] = gain * plates.force[rows, p], gain * plates.moment[rows, p]
    return context_of(replace(walk, plates=replace(plates, force=force, moment=moment)))


@pytest.mark.parametrize("late", [0, 1])
def test_a_late_plate(walk, late):
    delays_s = (0.025, 0.0) if late == 0 else (0.0, 0.025)
    (found,) = plate_delay(changed(walk, delays_s))
    assert found.code == "T216"
    names = walk.plates.names
    assert [found.evidence[name].value for name in ("plate", "other")] == [names[late], names[1 - late]]
    assert found.evidence["difference_s"].value == pytest.approx(0.025, abs=0.008)


@pytest.mark.parametrize(
    "fault",
    [{}, {"delays_s": (0.005, 0.0)}, {"delays_s": (0.025, 0.025)}, {"gains": (1.1, 1.0)}, {"gains": (1.0, 0.9)}],
    ids=["fault-free", "a little late", "both late", "gain of the first", "gain of the second"],
)
def test_no_late_plate(walk, fault):
    assert [*plate_delay(changed(walk, **fault))] == []
