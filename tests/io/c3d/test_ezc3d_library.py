"""C3D files where ezc3d is missing, and in folders whose names it cannot open on Windows."""

import shutil
import subprocess
import sys
import textwrap
from types import SimpleNamespace

import ezc3d
import numpy as np
import pytest

from kinertia.io.c3d.reader import read_c3d
from kinertia.io.c3d.writer import write_c3d
from refusals import refused

WITHOUT_EZC3D = """
    import sys
    sys.modules["ezc3d"] = None  # so that importing it fails
"""


def _python(code, *arguments):
    command = [sys.executable, "-c", textwrap.dedent(WITHOUT_EZC3D) + textwrap.dedent(code), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, encoding="utf-8", check=False)


@pytest.mark.slow
def test_without_ezc3d_a_c3d_file_says_what_to_install(c3d_lab):
    code = "from kinertia.cli.commands import main; main(['check', sys.argv[1]])"
    done = _python(code, c3d_lab / "walk.c3d")
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    for part in ("walk.c3d", "ezc3d", "conda install -c conda-forge ezc3d", "TRC"):
        assert part in last


def test_without_ezc3d_other_files_are_read_and_results_are_told_from(tmp_path):
    code = """
        from pathlib import Path
        import numpy as np
        import kinertia
        from kinertia.io.versions import versions
        from kinertia.io.text.trc import write_trc
        from kinertia.trial.data import Markers
        path = Path(sys.argv[1]) / "walk.trc"
        write_trc(path, Markers(np.arange(5) / 100, ("A", "B"), np.ones((5, 2, 3))))
        print(kinertia.read_recording(path).markers.labels, "numpy" in versions())
    """
    done = _python(code, tmp_path)
    assert done.stdout.strip() == "('A', 'B') True", done.stderr


def test_a_missing_reader_is_named(c3d_lab, monkeypatch):
    monkeypatch.setattr("kinertia.io.c3d.ezc3d_library.ezc3d", None)
    with refused("F107", None, package="ezc3d", how="conda install", others="TRC"):
        read_c3d(c3d_lab / "walk.c3d")


@pytest.fixture
def like_windows(monkeypatch):
    """ezc3d as it is on Windows: it finds no file whose path is not ASCII."""
    monkeypatch.setattr("kinertia.io.c3d.ezc3d_library.ONLY_ASCII_PATHS", True)
    real, write = ezc3d.c3d, ezc3d.c3d.write

    def opened(path="", **options):
        if not str(path).isascii():
            raise OSError("Could not open the c3d file: iostream stream error")
        return real(path, **options)

    def written(self, path):
        if not str(path).isascii():
            raise OSError("Could not open the c3d file: iostream stream error")
        return write(self, path)

    monkeypatch.setattr("kinertia.io.c3d.ezc3d_library.ezc3d", SimpleNamespace(c3d=opened))
    monkeypatch.setattr(real, "write", written)


@pytest.mark.parametrize("relative", [False, True], ids=["whole path", "from here"])
def test_a_name_with_umlauts_is_read_on_windows(c3d_lab, tmp_path, monkeypatch, like_windows, relative):
    folder = tmp_path / "Müller"
    folder.mkdir()
    shutil.copyfile(c3d_lab / "static.c3d", folder / "Stehen größer.c3d")
    monkeypatch.chdir(tmp_path)
    name = "Müller/Stehen größer.c3d"
    recording, expected = read_c3d(name if relative else tmp_path / name), read_c3d(c3d_lab / "static.c3d")
    np.testing.assert_array_equal(recording.markers.positions, expected.markers.positions)
    assert recording.name == "Stehen größer"


def test_a_name_with_umlauts_is_written_on_windows(c3d_lab, tmp_path, like_windows):
    recording = read_c3d(c3d_lab / "static.c3d")
    path = tmp_path / "Müller.c3d"
    write_c3d(path, recording)
    assert read_c3d(path).markers.labels == recording.markers.labels
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
