"""Markers that were low-passed far too strongly are found; a wrong rate is not taken for that."""

from dataclasses import replace

import pytest
from scipy.signal import butter, sosfiltfilt

from kinertia.diagnostics.markers.over_smoothed import over_smoothed
from kinertia.trial.data import Markers
from plate_findings import codes, context_of, found_in
from recordings import RUNS, WALKS

MEASURED = {**WALKS, **{f"run, {name}": files for name, files in RUNS.items()}}


@pytest.mark.parametrize("name", MEASURED)
def test_fault_free_markers(recording_of, name):
    assert [*over_smoothed(context_of(recording_of(*MEASURED[name])))] == []


def low_passed(recording, cutoff_hz):
    markers = recording.markers
    low_pass = butter(2, cutoff_hz, fs=markers.rate_hz, output="sos")
    return replace(recording, markers=replace(markers, positions=sosfiltfilt(low_pass, markers.positions, axis=0)))


@pytest.mark.parametrize("name", [name for name in ("synthetic", "synthetic c3d", "gait2354") if name in WALKS])
def test_markers_low_passed_at_2_hz(recording_of, name):
    walk = recording_of(*WALKS[name])
    context = context_of(low_passed(walk, 2.0))
    (found,) = over_smoothed(context)
    assert found.code == "M133"
    assert found.evidence["share"].value < found.evidence["share"].limit
    # what follows from it is not said beside it
    assert not {one[:3] for one in codes(found_in(context))} & {"P21", "P22", "P23"}
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
