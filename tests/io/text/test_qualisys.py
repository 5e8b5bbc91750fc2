"""TSV files of Qualisys Track Manager, written to its documented format: markers and plates come back."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinertia.findings.finding import Severity
from kinertia.io.recording import read_recording
from kinertia.trial.data import LOAD_THRESHOLD_N
from kinertia.trial.ground_contact import centre_of_pressure
from lab_files import CORNERS_M, LAB, lab_walk, write_qtm
from refusals import codes, only, refused


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
    assert codes(recording.findings) == ["F133"]


def test_a_plate_named_brings_the_others(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    recording = read_recording(path, tmp_path / "walk_f_2.tsv")
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-6)


def test_a_missing_file_among_the_plates_is_a_finding(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    (tmp_path / "walk_f_1.tsv").unlink()
    found = only(read_recording(path).findings, "F151")
    assert (found.where.file, found.where.plate, found.severity) == ("walk.tsv", "plate 1", Severity.WARNING)
    assert "walk_f_1.tsv" in found.evidence["reason"].value


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
    found = only(recording.findings, "F153")
    assert (found.where.file, found.severity) == ("walk_f_1.tsv", Severity.WARNING)
    assert found.where.plate == recording.plates.names[0]
    assert found.evidence["misses"].value > 0.05
    np.testing.assert_allclose(recording.plates.moment[..., [0, 2]], walk.plates.moment[..., [0, 2]], atol=1e-3)
    np.testing.assert_allclose(recording.plates.moment[:, 1], walk.plates.moment[:, 1], atol=1e-3)
    loaded = walk.plates.force[:, 0, 1] > LOAD_THRESHOLD_N
    force, point = walk.plates.force[loaded, 0], centre_of_pressure(walk.plates.wrench)[loaded, 0]
    without_free_moment = np.cross(point, force)[:, 1]
    assert np.abs(walk.plates.moment[loaded, 0, 1] - without_free_moment).max() > 0.5, "there is one to leave out"
    np.testing.assert_allclose(recording.plates.moment[loaded, 0, 1], without_free_moment, atol=1e-3)


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
    "no marker names": (lambda text: text.replace("MARKER_NAMES", "NAMES"), "F164", {"found": "MARKER_NAMES"}),
    "no rate": (lambda text: text.replace("FREQUENCY\t100", "FREQUENCY\tEXT"), "F114", {"value": "EXT"}),
    "no rows": (lambda text: text[: text.index("MARKER_NAMES")], "F103", {}),
    "a word in a row": (lambda text: text[:-40] + "\tnone\t" + text[-30:], "F105", {}),
}


@pytest.mark.parametrize(("spoil", "code", "evidence"), BAD.values(), ids=BAD.keys())
def test_what_is_wrong_is_named(tmp_path, walk, spoil, code, evidence):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    path.write_text(spoil(path.read_text()))
    with refused(code, **evidence):
        read_recording(path)


def test_a_header_that_counts_other_frames_is_a_finding(tmp_path, walk):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    path.write_text(re.sub(r"NO_OF_FRAMES\t\d+", "NO_OF_FRAMES\t7", path.read_text()))
    only(read_recording(path).findings, "F111", announced=7, found=len(walk.markers.time), what="frames")


@pytest.mark.parametrize(
    ("old", "new", "code", "evidence"),
    [
        ("FORCE_PLATE_CORNER_NEGX_NEGY_X", "SOMETHING", "F114", {"key": "CORNER_NEGX_NEGY_X", "value": "missing"}),
        ("COP_X", "COP_Q", "F156", {"columns": "COP_X"}),
        ("FREQUENCY\t1000", "FREQUENCY\t500", "F155", {"rate_hz": 500.0, "other": "walk_f_1.tsv"}),
    ],
)
def test_a_wrong_plate_is_named(tmp_path, walk, old, new, code, evidence):
    path = write_qtm(tmp_path / "walk.tsv", walk)
    plate = tmp_path / "walk_f_2.tsv"
    assert old in plate.read_text()
    plate.write_text(plate.read_text().replace(old, new))
    with refused(code, None, **evidence) as caught:
        read_recording(path)
    assert caught.value.path == plate
