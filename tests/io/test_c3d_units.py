"""C3D files whose unit of length is stated, empty, or has to be told from the size of a person."""

import numpy as np
import pytest

from c3d_writer import write_c3d
from kinertia.errors import FileError
from kinertia.io.c3d import read_c3d
from kinertia.io.recording import read_recording


@pytest.mark.parametrize("unit_in_file", ["", "m", "inch"])
def test_a_stated_length_unit_goes_before_what_the_file_says(tmp_path, unit_in_file):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (4, 9, 3))
    file = write_c3d(tmp_path / "x.c3d", 100.0 * person, [f"M{k}" for k in range(9)], unit=unit_in_file)
    recording = read_recording(file, length_unit="cm")
    assert recording.length_unit == "cm"
    extents = np.ptp(recording.markers.positions[..., 1], axis=1)
    np.testing.assert_allclose(extents, np.ptp(person[..., 2], axis=1), atol=1e-6)
    assert f"read in cm, as stated; POINT:UNITS says '{unit_in_file}'" in " ".join(recording.notes)


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0)])
def test_an_empty_length_unit_is_inferred_from_the_size_of_a_person(tmp_path, unit, metres):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (4, 9, 3))
    file = write_c3d(tmp_path / "x.c3d", person / metres, [f"M{k}" for k in range(9)], unit="")
    recording = read_c3d(file)
    assert recording.length_unit == unit
    np.testing.assert_allclose(
        np.ptp(recording.markers.positions[..., 1], axis=1), np.ptp(person[..., 2], axis=1), atol=1e-6
    )
    assert f"POINT:UNITS is empty; taken as {unit}" in " ".join(recording.notes)
    ant = write_c3d(tmp_path / "y.c3d", 0.1 * person, [f"M{k}" for k in range(9)], unit="")
    with pytest.raises(FileError, match=r"POINT:UNITS is empty, and its markers, which reach 0\.1"):
        read_c3d(ant)


def test_a_length_unit_is_inferred_though_no_frame_shows_every_marker(tmp_path):
    person = np.random.default_rng(0).uniform((0.0, 0.0, 0.0), (0.6, 0.5, 1.8), (40, 9, 3))
    for k in range(40):
        person[k, k % 8] = np.nan
    person[:, 8] = np.nan
    recording = read_c3d(write_c3d(tmp_path / "x.c3d", 1000.0 * person, [f"M{k}" for k in range(9)], unit=""))
    assert recording.length_unit == "mm"
