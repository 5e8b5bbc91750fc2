"""One recording that is listed as two trials is told, and so are its forces; two windows of one recording are not."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.repeated_trials import repeated_trials
from kinertia.settings import Subject
from kinertia.trial.trial_input import TrialInput
from kinertia.workflow.prepare import prepare
from recordings import WALKS


@pytest.fixture(scope="module")
def walk(recording_of):
    return recording_of(*WALKS["synthetic c3d"])


def test_a_recording_that_is_listed_twice(walk):
    again = replace(walk, name="walk 2")
    (warning,) = repeated_trials([walk, again], [None, None])
    assert f"'{walk.name}' and 'walk 2' have the same markers" in warning


def test_two_windows_of_a_recording(walk):
    assert repeated_trials([walk, walk], [(1.2, 1.5), (1.5, 1.9)]) == []
    assert len(repeated_trials([walk, walk], [(1.2, 1.6), (1.5, 1.9)])) == 1


def other_markers(walk):
    return replace(walk, name="walk 2", markers=replace(walk.markers, positions=np.round(walk.markers.positions, 4)))


def test_two_recordings(walk):
    other = other_markers(walk)
    plates = replace(other.plates, force=np.round(other.plates.force, 1))
    assert repeated_trials([walk, replace(other, plates=plates)], [None, None]) == []
    assert repeated_trials([replace(walk, plates=None), replace(other, plates=None)], [None, None]) == []
    idle = replace(walk.plates, force=np.zeros_like(walk.plates.force))
    assert repeated_trials([replace(walk, plates=idle), replace(other, plates=idle)], [None, None]) == []


def test_forces_of_the_other_trial(walk):
    other = other_markers(walk)
    (warning,) = repeated_trials([walk, other], [None, None])
    assert f"'{walk.name}' and 'walk 2' have the same forces to the last digit, but not the same markers" in warning
    assert repeated_trials([walk, other], [(1.2, 1.5), (1.5, 1.9)]) == []


def test_pieces_of_a_recording_may_have_the_forces_of_the_whole(walk):
    middle = len(walk.markers.time) // 2
    pieces = [
        replace(walk, markers=replace(walk.markers, time=walk.markers.time[k], positions=walk.markers.positions[k]))
        for k in (slice(None, middle), slice(middle, None))
    ]
    assert repeated_trials(pieces, [None, None]) == []


def test_the_fit_says_so(walk, recording_of):
    static = recording_of("synthetic/static.c3d")
    subject = Subject(name="A", sex="male", mass_kg=72.6, height_m=1.803)
    ready = prepare(subject, static, [TrialInput(walk), TrialInput(replace(walk, name="walk 2"))])
    assert any("have the same markers to the last digit" in warning for warning in ready.warnings)
