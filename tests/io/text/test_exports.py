"""A measured walk, written in the text formats of Qualisys and Vicon, is the walk of its C3D file."""

from dataclasses import replace

import numpy as np
import pytest

import lab_files
from kinertia.findings.finding import Severity
from kinertia.io.recording import read_recording
from refusals import only, refused


@pytest.mark.parametrize("name", ["pig_c3d/subject_a_walk.c3d"])
@pytest.mark.parametrize("kind", ["tsv", pytest.param("csv", marks=pytest.mark.slow)])
@pytest.mark.measured
def test_a_walk_comes_back(recording_of, tmp_path, monkeypatch, kind, name):
    walk = recording_of(name)
    corners = np.stack([plate @ lab_files.LAB for plate in walk.plates.corners])
    x, y = (
        corners[:, front].mean(axis=1) - corners[:, two].mean(axis=1)
        for front, two in (([0, 3], [1, 2]), ([0, 1], [2, 3]))
    )
    axes = np.stack([x, y, np.cross(x, y)], axis=1)
    monkeypatch.setattr(lab_files, "CORNERS_M", corners)
    monkeypatch.setattr(lab_files, "AXES", axes / np.linalg.norm(axes, axis=2, keepdims=True))
    path = tmp_path / f"walk.{kind}"
    if kind == "tsv":
        lab_files.write_qtm(path, walk, local=True)
    else:
        lab_files.write_nexus(path, walk, np.diag([1.0, -1.0, -1.0]))
    recording = read_recording(path)
    assert recording.markers.labels == walk.markers.labels
    np.testing.assert_allclose(recording.markers.positions, walk.markers.positions, atol=1e-6)
    np.testing.assert_allclose(recording.plates.force, walk.plates.force, atol=1e-5)
    np.testing.assert_allclose(recording.plates.moment, walk.plates.moment, atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "old", "new", "code", "evidence"),
    [
        ("tsv", "FREQUENCY\t100", "FREQUENCY\t0", "F114", {"key": "FREQUENCY", "value": "0"}),
        ("tsv", "NO_OF_FRAMES\t1", "NO_OF_FRAMES\tnan", "F114", {"key": "NO_OF_FRAMES", "value": "nan"}),
        ("csv", "\n100\n", "\n1..0\n", "F114", {"value": "1..0"}),
        ("csv", "\n1,0,", "\n1,-.-,", "F105", {"cell": "-.-", "column": 2}),
    ],
)
def test_broken_exports_are_refused(tmp_path, kind, old, new, code, evidence):
    recording = lab_files.lab_walk()
    markers = recording.markers
    order = [len(markers.labels) - 1, *range(len(markers.labels) - 1)]
    labels = tuple(markers.labels[k] for k in order)
    recording = replace(recording, markers=replace(markers, labels=labels, positions=markers.positions[:, order]))
    path = tmp_path / f"walk.{kind}"
    (lab_files.write_qtm if kind == "tsv" else lab_files.write_nexus)(path, recording)
    text = path.read_text(encoding="utf-8")
    assert old in text, text[:500]
    path.write_text(text.replace(old, new), encoding="utf-8")
    with refused(code, **evidence):
        read_recording(path)


def test_of_repeated_labels_of_qualisys_the_first_of_equals_is_kept(tmp_path):
    path = tmp_path / "walk.tsv"
    lab_files.write_qtm(path, lab_files.lab_walk())
    names = next(line for line in path.read_text(encoding="utf-8").split("\n") if line.startswith("MARKER_NAMES"))
    _, first, second, *_ = names.split("\t")
    path.write_text(path.read_text(encoding="utf-8").replace(f"\t{second}", f"\t{first}", 1), encoding="utf-8")
    recording = read_recording(path)
    assert second not in recording.markers.labels
    assert only(recording.findings, "F113", label=first, count=2).severity is Severity.INFO
