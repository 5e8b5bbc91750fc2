"""TSV files of Qualisys Track Manager, written to its documented format: markers and plates come back."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import FileError
from kinertia.io.recording import read_recording
from lab_files import CORNERS_M, LAB, lab_walk, write_qtm


@pytest.fixture(scope="module")
def walk():
    return lab_walk()


@pytest.mark.parametrize("local", [False, True], ids=["laboratory's axes", "plate's axes"])
@pytest.mark.parametrize("counted", [False, True], ids=["bare rows", "frame and time"])
def test_a_trial_comes_back(tmp_path, walk, local, counted):
    path = write_qtm(tmp_path / "walk.tsv", walk, local=local, counted=counted)
    recording = read_recording(path)
    assert recording.markers.labels == walk.markers.labels
    np.testing.assert_allclose(recording.markers.positions, walk.markers.positions, atol=1e-6)
    np.testing.assert_allclose(recording.markers.time, walk.markers.time, atol=1e-9)
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-6)
    np.testing.assert_allclose(recording.plates.moment, walk.plates.moment, atol=1e-3)
    np.testing.assert_allclose(recording.plates.corners, CORNERS_M @ LAB.T, atol=1e-6)
    assert (recording.length_unit, recording.vertical) == ("mm", "+Z")
    assert any("plates from walk_f_1.tsv, walk_f_2.tsv" in note for note in recording.notes)


def test_a_plate_named_brings_the_others(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    recording = read_recording(path, tmp_path / "walk_f_2.tsv")
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-6)


def test_forces_on_the_plate_are_reversed(tmp_path, walk):
    down = replace(walk, plates=replace(walk.plates, force=-walk.plates.force, moment=-walk.plates.moment))
    recording = read_recording(write_qtm(tmp_path / "walk.tsv", down, local=True))
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-6)
    np.testing.assert_allclose(recording.plates.moment, walk.plates.moment, atol=1e-3)


def test_moments_that_contradict_the_centre_of_pressure_are_not_used(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    plate = tmp_path / "walk_f_1.tsv"
    rows = plate.read_text().split("\n")
    rows = [line if not line[:1].lstrip("-").isdigit() else swapped(line) for line in rows]
    plate.write_text("\n".join(rows))
    recording = read_recording(path)
    assert any("walk_f_1.tsv: moments and centre of pressure contradict each other" in note for note in recording.notes)
    np.testing.assert_allclose(recording.plates.moment[..., [0, 2]], walk.plates.moment[..., [0, 2]], atol=1e-3)


def swapped(line):
    """Moments about x and y exchanged."""
    cells = line.split("\t")
    cells[3], cells[4] = cells[4], cells[3]
    return "\t".join(cells)


def test_missing_markers_are_missing(tmp_path, walk):
    positions = walk.markers.positions.copy()
    positions[3, 1] = np.nan
    gap = replace(walk, markers=replace(walk.markers, positions=positions))
    for hole in ("", "0.000", "NULL"):
        recording = read_recording(write_qtm(tmp_path / "walk.tsv", gap, hole=hole))
        assert np.isnan(recording.markers.positions[3, 1]).all()
        assert np.isfinite(recording.markers.positions[4]).all()


BAD = {
    "no marker names": (lambda text: text.replace("MARKER_NAMES", "NAMES"), "has no MARKER_NAMES"),
    "no rate": (lambda text: text.replace("FREQUENCY\t100", "FREQUENCY\tEXT"), "FREQUENCY is 'EXT'"),
    "no rows": (lambda text: text[: text.index("MARKER_NAMES")], "no row of numbers"),
    "a word in a row": (lambda text: text[:-40] + "\tnone\t" + text[-30:], "not a number|values, expected"),
}


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD.keys())
def test_what_is_wrong_is_said(tmp_path, walk, spoil, said):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(FileError, match=said):
        read_recording(path)


def test_a_plate_without_corners_is_named(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    plate = tmp_path / "walk_f_2.tsv"
    plate.write_text(plate.read_text().replace("FORCE_PLATE_CORNER_NEGX_NEGY_X", "SOMETHING"))
    with pytest.raises(FileError, match="no FORCE_PLATE_CORNER_NEGX_NEGY_X"):
        read_recording(path)
