"""Terminals and pipes that are not UTF-8, as on Windows: a letter that they lack never ends a command."""

import json
import os
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

from command_line import run_apart

NAME = "größe→ 歩行"
SEVERAL = """
import json, sys
from kinertia.cli.start import main
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["kinertia", *arguments]
    try:
        main()
    except SystemExit as end:
        for stream in (sys.stdout, sys.stderr):
            print(END, end.code or 0, file=stream, flush=True)
"""
"""Runs command lines one after the other: starting Python takes longer than they do."""
END = "--- ended with"


@pytest.fixture(scope="module", params=[pytest.param("ascii", marks=pytest.mark.slow), "cp1252"])
def encoding(request):
    return request.param


@pytest.fixture(scope="module")
def folder(tmp_path_factory, c3d_lab):
    folder = tmp_path_factory.mktemp("terminal") / NAME
    folder.mkdir()
    shutil.copyfile(c3d_lab / "walk.c3d", folder / f"{NAME}.c3d")
    return folder


@pytest.fixture(scope="module")
def done(encoding, folder):
    """Help, results and an error: status and what stood on both streams."""
    lines = ["--help"], ["check", str(folder / f"{NAME}.c3d"), "-o", str(folder / "out")], ["check", f"{NAME}.c3d"]
    command = [sys.executable, "-c", f"END = {END!r}{SEVERAL}", json.dumps(lines)]
    ended = subprocess.run(
        command, env=os.environ | {"PYTHONIOENCODING": encoding}, capture_output=True, encoding=encoding, check=False
    )
    assert ended.returncode == 0, ended.stderr
    streams = [re.split(rf"{END} (\d+)\n", stream)[:-1] for stream in (ended.stdout, ended.stderr)]
    return [
        SimpleNamespace(returncode=int(status), stdout=out, stderr=err)
        for out, status, err in zip(streams[0][::2], streams[0][1::2], streams[1][::2], strict=True)
    ]


def test_help(done):
    assert done[0].returncode == 0, done[0].stderr
    assert "Body segment parameters from gait" in done[0].stdout


def test_results_with_letters_that_it_lacks(encoding, done, folder):
    assert "Traceback" not in done[1].stderr
    assert done[1].returncode in (0, 1)
    assert f"page in {folder / 'out' / 'check.html'}".encode(encoding, "replace").decode(encoding) in done[1].stdout


def test_errors_with_letters_that_it_lacks(done):
    assert done[2].returncode == 2
    assert done[2].stderr.splitlines()[-1].startswith("error: ")
    assert "F101 " in done[2].stderr
    assert "Traceback" not in done[2].stderr


@pytest.mark.slow
def test_a_whole_fit(encoding, c3d_lab, tmp_path):
    done = run_apart("fit", c3d_lab / "subject.toml", "-o", tmp_path / NAME, encoding=encoding)
    assert done.status == 0, done.err
    assert "results in" in done.out
    assert (tmp_path / NAME / "report.html").is_file()


def test_a_process_ends_in_order():
    """All is written, and what is to be done at the end of a process is done."""
    program = (
        "import atexit, sys; from kinertia.cli.start import program; "
        "atexit.register(lambda: print('at its end')); sys.argv = ['kinertia', 'fit', 'none.toml']; "
        "print('before'); program()"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.split("\n")) == (2, ["before", "at its end", ""])
    assert re.fullmatch(r"error: .*none\.toml: F101 .*\n", ended.stderr)
