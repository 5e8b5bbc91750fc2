"""Exchanged force files of two trials of a person are named; those of sound trials, and late ones, never are."""

from itertools import combinations

import pytest

from kinertia.io.osim.reader import read_osim
from kinertia.model.model_markers import markers_of_model
from kinertia.motion.exchanged_forces import exchanged_forces
from subject4_trials import trial_of_subject4

TRIALS = ("walking1", "walking2", "squats1")


@pytest.fixture
def of_subject4(file_of, recording_of):
    """Trials of one person with the forces of others, late by so much (s), and the labels on each segment."""
    marker_set = markers_of_model(read_osim(file_of("subject4/addbiomechanics_scaled.osim")))

    def made(late_s=0.0, early_s=0.0, **forces):
        late = {"walking1": -early_s, "walking2": late_s}
        return [
            trial_of_subject4(recording_of, marker_set, name, of, late.get(name, 0.0)) for name, of in forces.items()
        ], marker_set.segments

    return made


@pytest.mark.parametrize("late_s", [0.0, 0.02, -0.05])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_sound_and_late_trials(of_subject4, count, late_s):
    for some in combinations(TRIALS, count):
        assert exchanged_forces(*of_subject4(late_s, **dict(zip(some, some, strict=True)))) == []


def test_one_late_and_the_other_early(of_subject4):
    for late_s in (0.01, 0.015, -0.01, -0.015):
        assert exchanged_forces(*of_subject4(late_s, late_s, walking1="walking1", walking2="walking2")) == []


def test_exchanged_force_files(of_subject4):
    trials, segments = of_subject4(walking1="walking2", walking2="walking1", squats1="squats1")
    (sentence,) = exchanged_forces(trials, segments)
    assert sentence.startswith("the forces of walking1 and walking2 seem to be exchanged")
    assert sentence.endswith("give each trial its own force file")
