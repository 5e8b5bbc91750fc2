"""Trials of a person whose forces are late by another time are named; trials that share a clock never are."""

from dataclasses import replace
from itertools import combinations

import pytest

from command_line import run
from kinertia.estimation.prepare import TrialInput
from kinertia.estimation.prepare_osim import prepare_osim
from kinertia.io.osim.reader import read_osim
from kinertia.model.model_markers import markers_of_model
from kinertia.motion.trial_delays import TrialDelay, trial_delay, trial_delays_doubts, uneven_delays
from kinertia.settings import Settings, Subject
from kinertia.trial.sampled_time import within
from subject4_trials import trial_of_subject4

TRIALS = ("walking1", "walking2", "squats1")


@pytest.fixture
def of_subject4(file_of, recording_of):
    """Trials of one person whose forces are late by so much (s), and the labels on each segment."""
    marker_set = markers_of_model(read_osim(file_of("subject4/addbiomechanics_scaled.osim")))

    def made(**late_s):
        return [
            trial_of_subject4(recording_of, marker_set, name, late_s=late) for name, late in late_s.items()
        ], marker_set.segments

    return made


def test_trials_that_share_a_clock(of_subject4):
    trials, segments = of_subject4(**dict.fromkeys(TRIALS, 0.0))
    for count in (1, 2, 3):
        for some in combinations(trials, count):
            assert uneven_delays(some, segments) == []


@pytest.mark.parametrize("late_s", [0.02, -0.02, 0.05])
def test_the_delay_is_told(of_subject4, late_s):
    for name in TRIALS:
        first, other = (
            trial_delay(trial, segments)
            for (trial,), segments in (of_subject4(**{name: 0.0}), of_subject4(**{name: late_s}))
        )
        assert other.by_pelvis_s - first.by_pelvis_s == pytest.approx(late_s, abs=0.001)
        assert other.by_centre_s - first.by_centre_s == pytest.approx(late_s, abs=0.001)


def test_one_of_two_is_late(of_subject4):
    (doubt,) = uneven_delays(*of_subject4(walking1=0.0, walking2=0.02))
    assert doubt.startswith("the forces of walking2 (+26 and +23 ms) come 20 ms later than those of walking1 (+7 and ")
    # which of two is wrong nobody knows
    (doubt,) = uneven_delays(*of_subject4(walking1=0.0, walking2=-0.02))
    assert doubt.startswith("the forces of walking1 (+7 and +3 ms) come 20 ms later than those of walking2 (-14 and ")


def test_one_of_three_is_early(of_subject4):
    (doubt,) = uneven_delays(*of_subject4(walking1=0.0, walking2=-0.03, squats1=0.0))
    assert doubt.startswith("the forces of walking2 (-24 and -27 ms) come 30 ms earlier than those of the other trials")


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
def test_walks_of_less_than_a_second(of_subject4, late_s):
    trials, segments = of_subject4(walking1=0.0, walking2=late_s)
    short = []
    for trial in trials:
        ((start_s, end_s),) = trial.windows()
        middle_s = (start_s + end_s) / 2
        inside = within(trial.markers.time, middle_s - 0.45, middle_s + 0.45)
        short.append(replace(trial, measured=trial.measured & inside))
    assert all(trial_delay(trial, segments).short for trial in short)
    assert len(uneven_delays(short, segments)) == (late_s != 0.0)


def test_said_by_a_fit(file_of, recording_of):
    model = read_osim(file_of("subject4/addbiomechanics_scaled.osim"))
    walks = [recording_of(f"subject4/{name}.trc", f"subject4/{name}_grf.mot") for name in TRIALS[:2]]
    late = replace(walks[1], plates=replace(walks[1].plates, time=walks[1].plates.time + 0.02))

    def said(*recordings):
        inputs = [TrialInput(one) for one in recordings]
        warnings = prepare_osim(Subject(mass_kg=60.0), model, inputs, Settings(), False).warnings
        return [one for one in warnings if "ms later than" in one]

    assert said(*walks) == []
    assert len(said(walks[0], late)) == 1


def test_said_by_check(file_of, tmp_path):
    """Of the trial that is late, by its name."""
    for name in ("walking1", "walking2"):
        for end in (".trc", "_grf.mot"):
            text = file_of(f"subject4/{name}{end}").read_text()
            if name == "walking2" and end == "_grf.mot":
                head, rows = text.split("endheader\n", 1)
                labels, *lines = rows.splitlines()
                late = [f"{float(line.split()[0]) + 0.02:.6f}\t" + "\t".join(line.split()[1:]) for line in lines]
                text = f"{head}endheader\n{labels}\n" + "\n".join(late) + "\n"
            (tmp_path / f"{name}{end}").write_text(text)
    model = file_of("subject4/addbiomechanics_scaled.osim")
    trials = "".join(
        f'[[trial]]\nname = "{n[-1]}. walk"\nmarkers = "{n}.trc"\nforces = "{n}_grf.mot"\n'
        for n in ("walking1", "walking2")
    )
    (tmp_path / "subject.toml").write_text(f'[subject]\nmass_kg = 60.0\n[model]\nosim = "{model.as_posix()}"\n{trials}')
    shown = " ".join(run("check", tmp_path / "subject.toml").out.split())
    assert shown.count("caution: the forces of 2. walk (+26 and +23 ms) come 20 ms later than those of 1. walk") == 1
