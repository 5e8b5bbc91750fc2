"""No warning of NumPy reaches the terminal, whatever a recording lacks: what is not seen is asked for, not averaged."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import KinertiaError
from kinertia.trial.data import Markers
from kinertia.workflow.check import check_recording
from recordings import here, slow_beside


def without(every):
    """One of so many markers is never seen."""

    def change(recording):
        positions = recording.markers.positions.copy()
        positions[:, ::every] = np.nan
        return replace(recording, markers=replace(recording.markers, positions=positions))

    return change


def hidden(seed):
    """All markers are hidden before and after, and half of what is left, by chance."""

    def change(recording):
        positions = recording.markers.positions.copy()
        count = len(positions)
        positions[: count // 3] = positions[-count // 3 :] = np.nan
        positions[np.random.default_rng(seed).random(positions.shape[:2]) < 0.5] = np.nan
        return replace(recording, markers=replace(recording.markers, positions=positions))

    return change


def short(count):
    """A few frames."""

    def change(recording):
        markers = recording.markers
        return replace(recording, markers=Markers(markers.time[:count], markers.labels, markers.positions[:count]))

    return change


def loads(frames):
    """Forces that are zero in part."""

    def change(recording):
        force = recording.plates.force.copy()
        force[frames] = 0.0
        return replace(recording, plates=replace(recording.plates, force=force))

    return change


def still(recording):
    """Nothing moves."""
    positions = np.repeat(recording.markers.positions[:1], len(recording.markers.time), axis=0)
    return replace(recording, markers=replace(recording.markers, positions=positions))


LACKS = {
    "one of two markers": without(2),
    "one of three": without(3),
    "most frames": hidden(1),
    "others": hidden(2),
    "all but two frames": short(2),
    "all but 20 frames": short(20),
    "loads": loads(...),
    "a plate": loads(np.s_[:, 0]),
    "horizontal forces": loads(np.s_[:, :, [0, 2]]),
    "motion": still,
}
RECORDINGS = here(
    [
        ("synthetic/walk.c3d", "synthetic/static.c3d"),
        ("pig_c3d/subject_a_walk.c3d", "pig_c3d/subject_a_static.c3d"),
    ]
)


@pytest.mark.parametrize("lack", LACKS)
@pytest.mark.parametrize("files", slow_beside(RECORDINGS[:1], RECORDINGS))
def test_what_a_recording_lacks_makes_no_warning(recording_of, files, lack):
    walk, static = files
    changed = LACKS[lack](recording_of(walk))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for is_static in (False, True):
            try:
                check_recording(changed, static=recording_of(static), is_static=is_static)
            except KinertiaError:
                continue
