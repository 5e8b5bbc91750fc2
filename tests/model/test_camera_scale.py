"""Trials that were recorded with another scale of the cameras are named; sound ones never are."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from kinertia.checks.files import PersonFiles, RecordingFiles, check_files
from kinertia.estimation.prepare import TrialInput
from kinertia.estimation.prepare_osim import prepare_osim
from kinertia.io.marker_set_file import choose_marker_set, read_marker_set
from kinertia.io.osim.reader import read_osim
from kinertia.io.trc import write_trc
from kinertia.model.camera_scale import scale_trouble, trial_scales
from kinertia.model.segment_distances import SegmentDistances
from kinertia.settings import Settings, Subject

STATIC = [
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
RUN_ON_A_TREADMILL = STATIC[-1]
TRIALS = ("walking1", "walking2", "squats1")


def scaled(markers, factor):
    """About the middle, so that the person stays on the plates."""
    middle = np.nanmean(markers.positions, axis=(0, 1))
    return replace(markers, positions=factor * (markers.positions - middle) + middle)


@pytest.fixture(params=STATIC, ids=[trial for _, trial in STATIC])
def told(request, recording_of):
    """What is said of somebody's trial against the static one, scaled by a factor."""
    static, trial = (recording_of(name).markers for name in request.param)
    marker_set = choose_marker_set(static.labels)

    def said(factor):
        if request.param == RUN_ON_A_TREADMILL and factor > 1.01:
            pytest.skip("its soft feet are shorter than in standing")
        return scale_trouble(SegmentDistances.of(static, scaled(trial, factor), marker_set))

    return said


@pytest.mark.parametrize("factor", [0.995, 1.0, 1.005])
def test_a_sound_static_trial(told, factor):
    """With a margin."""
    assert told(factor) == ""


@pytest.mark.parametrize(("factor", "word"), [(0.985, "shorter"), (1.015, "longer")])
def test_another_scale_than_in_the_static_trial(told, factor, word):
    assert f"% {word} than in the static trial" in told(factor)
    assert "cameras were calibrated anew" in told(factor)


@pytest.mark.parametrize("pair", list(permutations(TRIALS, 2)), ids="-".join)
def test_trials_of_one_person(recording_of, pair):
    markers = {name: recording_of(f"subject4/{name}.trc").markers for name in pair}
    marker_set = read_marker_set("opencap-mocap")
    assert trial_scales(list(markers.items()), marker_set) == []
    for factor, word in ((0.985, "shorter"), (1.015, "longer")):
        other = scaled(markers[pair[1]], factor)
        ((name, sentence),) = trial_scales([(pair[0], markers[pair[0]]), (pair[1], other)], marker_set)
        assert name == pair[1]
        assert f"% {word} than in '{pair[0]}'" in sentence


def test_check_names_the_file(file_of, recording_of, tmp_path):
    folder = file_of("subject4/static1.trc").parent
    write_trc(tmp_path / "walking2.trc", scaled(recording_of("subject4/walking2.trc").markers, 1.015))
    for one, count in ((folder, 0), (tmp_path, 2)):
        files = (folder / "static1.trc", folder / "walking1.trc", one / "walking2.trc")
        checks, mistakes = check_files(PersonFiles(tuple(RecordingFiles(path) for path in files)))
        assert not mistakes
        said = [[v.sentence for v in check.verdicts if "calibrated anew" in v.sentence] for _, check in checks]
        assert [len(sentences) for sentences in said] == [0, 0, count]


def test_a_fit_with_an_opensim_model_warns(recording_of, file_of):
    model = read_osim(file_of("gait2354/subject01_scaled.osim"))
    walk = recording_of("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot")
    other = replace(walk, name="other", markers=scaled(walk.markers, 1.015))
    ready = prepare_osim(Subject(name="A", mass_kg=72.6), model, [TrialInput(walk), TrialInput(other)], Settings())
    (warning,) = [one for one in ready.warnings if "calibrated anew" in one]
    assert warning.startswith("other: ")
    assert f"1.5 % longer than in '{walk.name}'" in warning
