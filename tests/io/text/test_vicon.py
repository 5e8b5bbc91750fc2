"""ASCII exports of Vicon Nexus, written to their documented format: markers and plates come back."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinertia.io.recording import read_recording
from lab_files import lab_walk, write_nexus
from refusals import ANY, codes, only, refused

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
    rotated = [] if np.array_equal(turn, np.eye(3)) else ["F154", "F154"]
    assert codes(recording.findings) == ["F163", *rotated, "F133"]
    assert [finding.where.plate for finding in recording.findings[1:-1]] == list(recording.plates.names)[: len(rotated)]


def test_an_empty_cell_is_a_missing_marker(tmp_path, walk):
    positions = walk.markers.positions.copy()
    positions[3, 1] = np.nan
    gap = replace(walk, markers=replace(walk.markers, positions=positions))
    recording = read_recording(write_nexus(tmp_path / "walk.csv", gap))
    assert np.isnan(recording.markers.positions[3, 1]).all()
    assert np.isfinite(np.delete(recording.markers.positions, 3, axis=0)).all()


def twice(text, other):
    """The text with all trajectories once more, those of another person 2 m away."""
    before, trajectories = text.split("Trajectories\n")
    rate, owners, names, units, *rows = trajectories.rstrip().split("\n")
    labels = owners.replace("Anna:", other).removeprefix(",,")
    away = [",".join(str(float(cell) + 2000.0) for cell in row.split(",")[2:]) for row in rows]
    lines = [rate, f"{owners},{labels}", names + names.removeprefix("Frame,Sub Frame"), units + units[1:]]
    return "\n".join([f"{before}Trajectories", *lines, *(f"{a},{b}" for a, b in zip(rows, away, strict=True))]) + "\n"


BAD = {
    "two people": (
        lambda text: twice(text, "Ben:"),
        None,
        "F161",
        {"count": 2},
    ),
    "no trajectories": (lambda text: text.replace("Trajectories", "Joints"), None, "F164", {}),
    "no labels": (lambda text: re.sub(r"\n,,[^\n]*Head[^\n]*", "\n", text, count=1), None, "F164", {}),
    "another table": (lambda text: "a,b\n1,2\n3,4\n5,6\n7,8\n9,10\n", None, "F103", {}),
    "a frame left out": (
        lambda text: text.replace("\n21,0,", "\n22,0,", 2),
        ANY,
        "T101",
        {"step_s": 0.02, "usual_s": 0.01},
    ),
    "a word": (lambda text: text.replace("\n7,0,", "\n7,0,none", 2), ANY, "F105", {"cell": "none", "column": 3}),
    "too many cells": (
        lambda text: text.replace("\n7,0,", "\n7,0,1,1,", 2),
        ANY,
        "F105",
        {"found": "values in the row"},
    ),
    "an infinite number": (
        lambda text: text.replace("\n7,0,0.000000,", "\n7,0,1e400,", 1),
        ANY,
        "F105",
        {"cell": "1e400", "column": 3},
    ),
    "no frame": (lambda text: text.replace("\n7,3,", "\n,3,", 1), 69, "T101", {"after": "no number"}),
    "a sample lost": (lambda text: re.sub("\n7,3,[^\n]*", "", text, count=1), 69, "T101", {"step_s": 0.002}),
    "odd units": (lambda text: text.replace("N.mm", "lbf.in"), None, "F121", {"unit": "lbf.in", "what": "moments"}),
}


@pytest.mark.parametrize(("spoil", "line", "code", "evidence"), BAD.values(), ids=BAD.keys())
def test_what_is_wrong_is_named(tmp_path, walk, spoil, line, code, evidence):
    path = write_nexus(tmp_path / "walk.csv", walk)
    path.write_text(spoil(path.read_text()))
    with refused(code, line, **evidence):
        read_recording(path)


def test_a_plate_without_a_centre_of_pressure_is_left_out(tmp_path, walk):
    path = write_nexus(tmp_path / "walk.csv", walk)
    first, second = read_recording(path).plates.names
    path.write_text(path.read_text().replace(f"{first} - CoP", "Something - CoP"))
    recording = read_recording(path)
    assert only(recording.findings, "F151").where.plate == first
    assert recording.plates.names == (second,)


def test_moments_that_contradict_the_centre_of_pressure_are_not_used(tmp_path, walk):
    """Moments about y and z are exchanged."""
    path = write_nexus(tmp_path / "walk.csv", walk)
    path.write_text(path.read_text().replace("Mx,My,Mz", "Mx,Mz,My"))
    recording = read_recording(path)
    found = [finding for finding in recording.findings if finding.code == "F153"]
    assert [finding.where.plate for finding in found] == list(recording.plates.names)
    assert all(finding.evidence["misses"].value > 0.05 for finding in found)
