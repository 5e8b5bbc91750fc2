"""Subjects of AddBiomechanics: all their trials, and what is said where nimblephysics is not installed."""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import kinertia
from command_line import run
from kinertia.errors import FileError
from kinertia.io.b3d import about_origin, read_b3d

FORCE = np.array([20.0, 700.0, -30.0])
POINT = np.array([0.4, 0.0, -0.1])
FREE = np.array([0.0, 3.0, 0.0])


def frame(n: int) -> SimpleNamespace:
    markers = [("RHEE", np.array([0.01 * n, 0.05, 0.1]))]
    if n != 1:
        markers.append(("LHEE", np.array([0.0, 0.05, -0.1])))
    return SimpleNamespace(
        markerObservations=markers,
        rawForcePlateForces=[FORCE, np.zeros(3)],
        rawForcePlateTorques=[FREE, np.zeros(3)],
        rawForcePlateCenterOfPressures=[POINT, np.full(3, np.nan)],
    )


class Subject:
    """What is used of nimblephysics' SubjectOnDisk."""

    def __init__(self, path: str) -> None:
        if "broken" in path:
            raise RuntimeError("no header")

    getNumTrials = staticmethod(lambda: 3)
    getTrialName = staticmethod(lambda k: "walk")
    getTrialLength = staticmethod(lambda k: (4, 0, 3)[k])
    getTrialTimestep = staticmethod(lambda k: 0.01)
    getMassKg = staticmethod(lambda: 70.5)
    getHeightM = staticmethod(lambda: 0.0)

    @staticmethod
    def readFrames(trial, start, count, includeSensorData, includeProcessingPasses):
        assert includeSensorData
        assert not includeProcessingPasses
        return [frame(n) for n in range(start, start + count)]


@pytest.fixture
def nimble(monkeypatch):
    library = ModuleType("nimblephysics_libs._nimblephysics")
    library.biomechanics = SimpleNamespace(SubjectOnDisk=Subject)
    monkeypatch.setitem(sys.modules, "nimblephysics_libs", ModuleType("nimblephysics_libs"))
    monkeypatch.setitem(sys.modules, "nimblephysics_libs._nimblephysics", library)


def a_file(folder, name="subject.b3d"):
    path = folder / name
    path.write_bytes(b"b3d")
    return path


def test_trials_with_frames_are_read(nimble, tmp_path):
    first, last = kinertia.read_b3d(a_file(tmp_path))
    assert (first.name, last.name) == ("walk_1", "walk_3")
    assert (first.mass_kg, first.height_m) == (70.5, None)
    np.testing.assert_allclose(first.markers.time, [0.0, 0.01, 0.02, 0.03])
    assert first.markers.labels == ("RHEE", "LHEE")
    assert np.isnan(first.markers.positions[1, 1]).all()
    np.testing.assert_allclose(first.markers.positions[3, 0], [0.03, 0.05, 0.1])
    np.testing.assert_allclose(first.plates.force[:, 0], np.tile(FORCE, (4, 1)))
    np.testing.assert_allclose(first.plates.moment[:, 0], np.tile(np.cross(POINT, FORCE) + FREE, (4, 1)))
    assert not first.plates.force[:, 1].any()


def test_torques_about_either_point_are_known_apart():
    force, point = np.tile(FORCE, (5, 1, 1)), np.tile(POINT, (5, 1, 1))
    expected = np.cross(point, force) + FREE
    np.testing.assert_allclose(about_origin(force, np.tile(FREE, (5, 1, 1)), point), expected)
    np.testing.assert_allclose(about_origin(force, expected, point), expected)


def test_without_nimblephysics_it_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "nimblephysics_libs", None)
    with pytest.raises(FileError, match="pip install nimblephysics"):
        read_b3d(a_file(tmp_path))


def test_broken_and_missing_files_are_refused(nimble, tmp_path):
    with pytest.raises(FileError, match=r"damaged \(no header\)"):
        read_b3d(a_file(tmp_path, "broken.b3d"))
    with pytest.raises(FileError):
        read_b3d(tmp_path / "nowhere.b3d")


def test_commands_point_to_it(tmp_path):
    with pytest.raises(FileError, match=r"kinertia\.read_b3d"):
        kinertia.read_recording(a_file(tmp_path))
    for command in ("fit", "check", "markers"):
        refused = run(command, a_file(tmp_path))
        assert refused.status == 2
        assert "kinertia.read_b3d" in refused.err, command


def test_a_subject_that_nimblephysics_wrote():
    """Version 0.10.52, which crashes where NumPy 2 gives it arrays, and reads well beside it."""
    pytest.importorskip("nimblephysics_libs._nimblephysics")
    (walk,) = read_b3d(Path(__file__).with_name("nimblephysics.b3d"))
    assert (walk.name, walk.mass_kg, walk.height_m) == ("walk", 64.0, 1.7)
    np.testing.assert_allclose(walk.markers.positions[:, 0, 0], 0.01 * np.arange(5), atol=1e-6)
    np.testing.assert_allclose(walk.plates.force[:, 0], np.tile(FORCE, (5, 1)), rtol=1e-6)
    np.testing.assert_allclose(walk.plates.moment[:, 0], np.tile(np.cross(POINT, FORCE) + FREE, (5, 1)), rtol=1e-5)
