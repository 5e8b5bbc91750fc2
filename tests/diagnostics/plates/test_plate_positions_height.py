"""Plates, and centres of pressure in force files, that lie above the soles of the feet on them."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.plates.plate_positions import plate_heights
from kinertia.io.ground_forces import read_forces
from kinertia.io.recording import read_recording
from kinertia.io.text.sto import read_table, write_table
from people import person
from recordings import WALKS, here, is_here, marker_set_for

RAISED_M = 0.05


def found_in(recording):
    return list(plate_heights(person([recording], marker_set=marker_set_for(recording.markers.labels))))


@pytest.mark.parametrize("name", WALKS)
def test_feet_stand_on_their_plates(recording_of, name):
    assert found_in(recording_of(*WALKS[name])) == []


@pytest.mark.parametrize("name", here(["synthetic/walk.c3d", "pig_c3d/subject_a_walk.c3d"]))
def test_corners_above_the_soles(recording_of, name):
    recording = recording_of(name)
    raised = replace(recording.plates, corners=recording.plates.corners + np.array([0.0, RAISED_M, 0.0]))
    found = found_in(replace(recording, plates=raised))
    assert {finding.code for finding in found} == {"P249"}
    assert {finding.where.plate for finding in found} == set(raised.names)
    for finding in found:
        assert finding.evidence["surface_m"].value == pytest.approx(RAISED_M)
        assert 0.0 < finding.evidence["depth_m"].value < RAISED_M


@pytest.mark.parametrize(
    "name", [name for name in ("synthetic/walk", "gait2354/subject01_walk1") if is_here(f"{name}.trc")]
)
def test_centres_of_pressure_above_the_soles(file_of, tmp_path, name):
    """Ankle moments were wrong by 7 N m, four of their SDs, and "use" was the verdict."""
    table, (as_it_is, _) = read_table(file_of(f"{name}_grf.mot")), read_forces(file_of(f"{name}_grf.mot"))
    heights = [k for k, label in enumerate(table.labels) if label.endswith("py")]
    table.values[:, heights] += RAISED_M
    write_table(tmp_path / "grf.mot", table, "grf")
    recording = read_recording(file_of(f"{name}.trc"), tmp_path / "grf.mot")
    raised = read_forces(tmp_path / "grf.mot")[0].torques[0].height_m
    assert raised - as_it_is.torques[0].height_m == pytest.approx(RAISED_M)
    assert {finding.code for finding in found_in(recording)} == {"P249"}
