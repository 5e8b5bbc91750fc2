"""One recording that is listed as two trials is found, and so are its forces; two windows of one recording are not."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.subject.same_person import repeated_trials
from people import person
from recordings import WALKS


@pytest.fixture(scope="module")
def walk(recording_of):
    return recording_of(*WALKS["synthetic c3d"])


def found(first, other, windows=(None, None)):
    """Code, trial and the other trial of each finding."""
    context = person([first, other])
    trials = [replace(trial, window_s=window) for trial, window in zip(context.trials, windows, strict=True)]
    return [
        (finding.code, finding.where.trial, finding.evidence["other_trial"].value)
        for finding in repeated_trials(replace(context, trials=trials))
    ]


def test_a_recording_that_is_listed_twice(walk):
    assert found(walk, replace(walk, name="walk 2")) == [("S302", "walk 2", walk.name)]


def test_two_windows_of_a_recording(walk):
    assert found(walk, walk, ((1.2, 1.5), (1.5, 1.9))) == []
    assert len(found(walk, walk, ((1.2, 1.6), (1.5, 1.9)))) == 1


def other_markers(walk):
    return replace(walk, name="walk 2", markers=replace(walk.markers, positions=np.round(walk.markers.positions, 4)))


def test_two_recordings(walk):
    other = other_markers(walk)
    plates = replace(other.plates, force=np.round(other.plates.force, 1))
    assert found(walk, replace(other, plates=plates)) == []
    assert found(replace(walk, plates=None), replace(other, plates=None)) == []
    unloaded = replace(walk.plates, force=np.zeros_like(walk.plates.force))
    assert found(replace(walk, plates=unloaded), replace(other, plates=unloaded)) == []


def test_forces_of_the_other_trial(walk):
    other = other_markers(walk)
    assert found(walk, other) == [("S303", "walk 2", walk.name)]
    assert found(walk, other, ((1.2, 1.5), (1.5, 1.9))) == []


def test_pieces_of_a_recording_may_have_the_forces_of_the_whole(walk):
    middle = len(walk.markers.time) // 2
    pieces = [
        replace(walk, markers=replace(walk.markers, time=walk.markers.time[k], positions=walk.markers.positions[k]))
        for k in (slice(None, middle), slice(middle, None))
    ]
    assert found(*pieces) == []
