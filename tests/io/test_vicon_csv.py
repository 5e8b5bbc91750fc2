"""ASCII exports of Vicon Nexus, written to their documented format: markers and plates come back."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinertia.errors import FileError
from kinertia.io.recording import read_recording
from lab_files import lab_walk, write_nexus

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
TURNS = {
    "as the laboratory": np.eye(3),
    "z down": np.diag([1.0, -1.0, -1.0]),
    "a quarter, z down": None,
    "a quarter": QUARTER,
}
TURNS["a quarter, z down"] = QUARTER @ np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def walk():
    return lab_walk()


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
@pytest.mark.parametrize("mark", [",", "\t"], ids=["CSV", "TXT"])
def test_a_trial_comes_back_whatever_axes_its_forces_are_in(tmp_path, walk, turn, mark):
    recording = read_recording(write_nexus(tmp_path / "walk.csv", walk, turn, mark))
    assert recording.markers.labels == walk.markers.labels
    np.testing.assert_allclose(recording.markers.positions, walk.markers.positions, atol=1e-6)
    np.testing.assert_allclose(recording.markers.time, walk.markers.time, atol=1e-9)
    np.testing.assert_allclose(recording.plates.time, walk.plates.time, atol=1e-9)
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-5)
    np.testing.assert_allclose(recording.plates.moment, walk.plates.moment, atol=1e-3)
    turned = [note for note in recording.notes if "in the plate's axes" in note]
    assert len(turned) == (0 if np.array_equal(turn, np.eye(3)) else 2)


def test_an_empty_cell_is_a_missing_marker(tmp_path, walk):
    positions = walk.markers.positions.copy()
    positions[3, 1] = np.nan
    gap = replace(walk, markers=replace(walk.markers, positions=positions))
    recording = read_recording(write_nexus(tmp_path / "walk.csv", gap))
    assert np.isnan(recording.markers.positions[3, 1]).all()
    assert np.isfinite(np.delete(recording.markers.positions, 3, axis=0)).all()


BAD = {
    "no trajectories": (lambda text: text.replace("Trajectories", "Joints"), "no section Trajectories"),
    "another table": (lambda text: "a,b\n1,2\n3,4\n5,6\n7,8\n9,10\n", "no section of an ASCII export"),
    "a frame left out": (lambda text: text.replace("\n21,0,", "\n22,0,", 2), "frame 22 follows frame 20"),
    "a word": (lambda text: text.replace("\n7,0,", "\n7,0,none", 2), "'none.*' is not a number"),
    "an infinite number": (
        lambda text: text.replace("\n7,0,0.000000,", "\n7,0,1e400,", 1),
        "infinite value in column 3",
    ),
    "no frame": (
        lambda text: text.replace("\n7,3,", "\n,3,", 1),
        "line 69: the sample of frame nan, sub frame 3, is not",
    ),
    "a sample lost": (
        lambda text: re.sub("\n7,3,[^\n]*", "", text, count=1),
        "line 69: the sample of frame 7, sub frame 4",
    ),
    "odd units": (lambda text: text.replace("N.mm", "lbf.in"), "moments in 'lbf.in'"),
}


@pytest.mark.parametrize(("spoil", "said"), BAD.values(), ids=BAD.keys())
def test_what_is_wrong_is_said(tmp_path, walk, spoil, said):
    path = write_nexus(tmp_path / "walk.csv", walk)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(FileError, match=said):
        read_recording(path)
