"""Terminals and pipes that are not UTF-8, as on Windows: a letter that they lack never ends a command."""

import os
import shutil
import subprocess
import sys

import pytest

NAME = "größe→ 歩行"


def _kinertia(encoding, *arguments):
    command = [sys.executable, "-c", "from kinertia.cli.start import main; main()", *map(str, arguments)]
    return subprocess.run(
        command, env=os.environ | {"PYTHONIOENCODING": encoding}, capture_output=True, encoding=encoding, check=False
    )


@pytest.fixture(scope="module", params=["ascii", "cp1252"])
def encoding(request):
    return request.param


def test_help(encoding):
    done = _kinertia(encoding, "--help")
    assert done.returncode == 0, done.stderr
    assert "Body segment parameters from gait" in done.stdout


def test_results_with_letters_that_it_lacks(encoding, tmp_path, measured_walk):
    folder = tmp_path / NAME
    folder.mkdir()
    shutil.copyfile(measured_walk / "walk.c3d", folder / f"{NAME}.c3d")
    done = _kinertia(encoding, "check", folder / f"{NAME}.c3d", "-o", folder / "out")
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1)
    assert f"page in {folder / 'out' / 'check.html'}".encode(encoding, "replace").decode(encoding) in done.stdout


def test_errors_with_letters_that_it_lacks(encoding, tmp_path):
    done = _kinertia(encoding, "check", tmp_path / f"{NAME}.c3d")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("error: ")
    assert "no such file" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_whole_fit(encoding, tmp_path):
    done = _kinertia(encoding, "demo", "--measured", "-o", tmp_path / NAME)
    assert done.returncode == 1, done.stderr  # a check of the measured walk fails
    assert "results in" in done.stdout
    assert (tmp_path / NAME / "report.html").is_file()
