"""Trials that were recorded with another scale of the cameras are named; sound ones never are."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from kinertia.diagnostics.evidence.segment_distances import SegmentDistances
from kinertia.diagnostics.subject.camera_scale import scale_trouble, trial_scales
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.io.trc import write_trc
from kinertia.settings import Settings, Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.files import PersonFiles, RecordingFiles, check_files
from kinertia.workflow.prepare_osim import prepare_osim
from recordings import here, named_here
from trials_of_people import PEOPLE

KNOWN = [
    ("synthetic/static.trc", "synthetic/walk.trc"),
    ("synthetic/static.trc", "synthetic/run.trc"),
    ("synthetic/static.trc", "synthetic/squats.trc"),
    ("synthetic/static.c3d", "synthetic/walk.c3d"),
    ("synthetic/clusters_static.trc", "synthetic/clusters_walk.trc"),
    ("gait2354/subject01_static.trc", "gait2354/subject01_walk1.trc"),
    ("rajagopal_walk/static_walk_1.trc", "rajagopal_walk/motion_capture_walk.trc"),
    ("pig_c3d/subject_a_static.c3d", "pig_c3d/subject_a_walk.c3d"),
    ("pig_c3d/subject_b_static.c3d", "pig_c3d/subject_b_walk.c3d"),
    ("subject4/static1.trc", "subject4/walking1.trc"),
    ("subject4/static1.trc", "subject4/walking2.trc"),
    ("subject4/static1.trc", "subject4/squats1.trc"),
    ("field/rajagopal_run/static_run.trc", "field/rajagopal_run/motion_capture_run.trc"),
    ("field/hamner_run/subject02_static.trc", "field/hamner_run/subject02_running.trc"),
]
STATIC = here(KNOWN)
RUN_ON_A_TREADMILL = KNOWN[-1]
"""The runner's soft feet are shorter than in standing: a scale that makes them longer is not seen."""
OTHER_SCALES = [
    (pair, factor, word)
    for pair in STATIC
    for factor, word in ((0.985, "shorter"), (1.015, "longer"))
    if factor < 1.0 or pair != RUN_ON_A_TREADMILL
]
PAIRS = [(name, *pair) for name, person in PEOPLE.items() for pair in permutations(person.trials, 2)]
MARKER_SETS = {"synthetic": "cleveland-clinic", "subject4": "opencap-mocap"}
STANDING_AND_TWO_WALKS = named_here(
    {
        "synthetic": ("synthetic/static.trc", "synthetic/walk.trc", "synthetic/alike.trc"),
        "subject4": ("subject4/static1.trc", "subject4/walking1.trc", "subject4/walking2.trc"),
    }
)


def scaled(markers, factor):
    """About the middle, so that the person stays on the plates."""
    middle = np.nanmean(markers.positions, axis=(0, 1))
    return replace(markers, positions=factor * (markers.positions - middle) + middle)


@pytest.fixture
def told(recording_of):
    """What is said of somebody's trial against the static one, scaled by a factor."""

    def said(pair, factor):
        static, trial = (recording_of(name).markers for name in pair)
        return scale_trouble(SegmentDistances.of(static, scaled(trial, factor), choose_marker_set(static.labels)))

    return said


@pytest.mark.parametrize("factor", [0.995, 1.0, 1.005])
@pytest.mark.parametrize("pair", STATIC, ids=[trial for _, trial in STATIC])
def test_a_sound_static_trial(told, pair, factor):
    """With a margin."""
    assert told(pair, factor) == ""


@pytest.mark.parametrize(("pair", "factor", "word"), OTHER_SCALES)
def test_another_scale_than_in_the_static_trial(told, pair, factor, word):
    assert f"% {word} than in the static trial" in told(pair, factor)
    assert "cameras were calibrated anew" in told(pair, factor)


@pytest.mark.parametrize(("person", "first", "second"), PAIRS)
def test_trials_of_one_person(recording_of, person, first, second):
    markers, others = (recording_of(*PEOPLE[person].files(name)).markers for name in (first, second))
    marker_set = read_marker_set(MARKER_SETS[person])
    assert trial_scales([(first, markers), (second, others)], marker_set) == []
    for factor, word in ((0.985, "shorter"), (1.015, "longer")):
        ((name, sentence),) = trial_scales([(first, markers), (second, scaled(others, factor))], marker_set)
        assert name == second
        assert f"% {word} than in '{first}'" in sentence


@pytest.mark.parametrize("person", STANDING_AND_TWO_WALKS)
def test_check_names_the_file(file_of, recording_of, tmp_path, person):
    *names, last = STANDING_AND_TWO_WALKS[person]
    static, first, sound = (file_of(name) for name in (*names, last))
    wrong = tmp_path / sound.name
    write_trc(wrong, scaled(recording_of(last).markers, 1.015))
    for second, count in ((sound, 0), (wrong, 2)):
        checks, mistakes = check_files(PersonFiles(tuple(RecordingFiles(path) for path in (static, first, second))))
        assert not mistakes
        said = [[v.sentence for v in check.verdicts if "calibrated anew" in v.sentence] for _, check in checks]
        assert [len(sentences) for sentences in said] == [0, 0, count]


def test_a_fit_with_an_opensim_model_warns(recording_of, file_of):
    model = read_osim(file_of("synthetic/scaled.osim"))
    walk = recording_of("synthetic/walk.trc", "synthetic/walk_grf.mot")
    other = replace(walk, name="other", markers=scaled(walk.markers, 1.015))
    ready = prepare_osim(Subject(name="A", mass_kg=72.6), model, [TrialInput(walk), TrialInput(other)], Settings())
    (warning,) = [one for one in ready.warnings if "calibrated anew" in one]
    assert warning.startswith("other: ")
    assert f"1.5 % longer than in '{walk.name}'" in warning
