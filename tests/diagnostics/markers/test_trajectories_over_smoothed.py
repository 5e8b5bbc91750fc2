"""Markers that were low-passed far too strongly are found; a wrong rate is not taken for that."""

from dataclasses import replace

import pytest
from scipy.signal import butter, sosfiltfilt

from kinertia.diagnostics.markers.trajectories import over_smoothed
from kinertia.findings.finding import Severity
from kinertia.trial.data import Markers
from plate_findings import codes, context_of, found_in
from recordings import RUNS, WALKS

MEASURED = {**WALKS, **{f"run, {name}": files for name, files in RUNS.items()}}


@pytest.mark.parametrize("name", MEASURED)
def test_fault_free_markers(recording_of, name):
    assert [*over_smoothed(context_of(recording_of(*MEASURED[name])))] == []


def low_passed(recording, cutoff_hz):
    """Of the markers that are never lost."""
    positions, seen = recording.markers.positions.copy(), recording.markers.seen.all(axis=0)
    low_pass = butter(2, cutoff_hz, fs=recording.markers.rate_hz, output="sos")
    positions[:, seen] = sosfiltfilt(low_pass, positions[:, seen], axis=0)
    return replace(recording, markers=replace(recording.markers, positions=positions))


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("cutoff_hz", [2.0, 3.0])
def test_markers_low_passed_far_too_strongly(recording_of, name, cutoff_hz):
    """At 3 Hz, the body was accused in five walks of six, and bars were 3 to 4 times too short."""
    walk = recording_of(*WALKS[name])
    context = context_of(low_passed(walk, cutoff_hz))
    (found,) = over_smoothed(context)
    assert (found.code, found.severity) == ("M133", Severity.ERROR)
    assert found.evidence["share"].value < found.evidence["share"].limit
    # what follows from it is not said beside it
    assert not {code[:3] for code in codes(found_in(context))} & {"P21", "P22", "P23"}
    assert [*over_smoothed(context_of(low_passed(walk, 6.0)))] == []


def test_a_file_at_half_its_rate(recording_of):
    walk = recording_of(*WALKS["synthetic"])
    markers, plates = walk.markers, walk.plates
    slow = replace(
        walk,
        markers=Markers(2.0 * markers.time, markers.labels, markers.positions),
        plates=replace(plates, time=2.0 * plates.time),
    )
    assert [*over_smoothed(context_of(slow))] == []
