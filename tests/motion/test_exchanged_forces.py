"""Exchanged force files of two trials of a person are named; those of sound trials, and late ones, never are."""

from dataclasses import replace
from itertools import combinations

import pytest

from kinertia.io.osim.reader import read_osim
from kinertia.model.model_markers import markers_of_model
from kinertia.motion.exchanged_forces import exchanged_forces
from kinertia.trial.plate_assignment import build_trial

TRIALS = ("walking1", "walking2", "squats1")


@pytest.fixture
def of_subject4(measured_file, measured_recording):
    """Trials of one person with the forces of others, late by so much (s), and the labels on each segment."""
    marker_set = markers_of_model(read_osim(measured_file("subject4/addbiomechanics_scaled.osim")))

    def made(late_s=0.0, **forces):
        trials = []
        for name, of in forces.items():
            recording = measured_recording(f"subject4/{name}.trc", f"subject4/{of}_grf.mot")
            feet = {
                side: [one for one in own if one in recording.markers.labels]
                for side, own in marker_set.foot_labels().items()
            }
            plates = replace(recording.plates, time=recording.plates.time + late_s * (name == "walking2"))
            trials.append(build_trial(replace(recording, plates=plates, name=name), feet))
        return trials, marker_set.segments

    return made


@pytest.mark.parametrize("late_s", [0.0, 0.02, -0.05])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_sound_and_late_trials(of_subject4, count, late_s):
    for some in combinations(TRIALS, count):
        assert exchanged_forces(*of_subject4(late_s, **dict(zip(some, some, strict=True)))) == []


def test_exchanged_force_files(of_subject4):
    trials, segments = of_subject4(walking1="walking2", walking2="walking1", squats1="squats1")
    (sentence,) = exchanged_forces(trials, segments)
    assert sentence.startswith("the forces of walking1 and walking2 seem to be exchanged")
    assert sentence.endswith("give each trial its own force file")
