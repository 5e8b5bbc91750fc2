"""Damaged files of every format: accepted or refused, never a traceback, a crash, a hang or a full memory."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fuzz
from command_line import run
from kinertia.findings.finding import Severity
from kinertia.io.recording import read_recording
from recordings import here
from refusals import refused
from validation.measured_data import places

LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of time and memory are Linux'")


@LINUX
@pytest.mark.parametrize(
    ("seed", "cases", "commands"),
    [(1, 120, 8), pytest.param(2, 2_000, 240, marks=pytest.mark.slow)],
    ids=["some", "two thousand"],
)
def test_damaged_files(tmp_path, seed, cases, commands):
    command = [sys.executable, "-W", "ignore", fuzz.__file__, tmp_path, seed, 0, cases, commands]
    places = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, env=places)
    assert done.returncode == 0, done.stderr[-2000:]
    assert 0.05 * cases < int(done.stdout) < 0.8 * cases, "damage that matters, and damage that does not"


REPRODUCERS = [path for place in places() for path in sorted((place.parent / "reproducers").glob("*.c3d"))]
"""Files beside the measured data, where they are on this machine."""


@pytest.mark.parametrize("path", REPRODUCERS, ids=lambda path: path.stem)
def test_c3d_files_on_which_ezc3d_crashes_or_hangs(path):
    outcome = run("check", path)
    assert outcome.status == 2
    (line,) = [line for line in outcome.err.splitlines() if line != "reading"]
    assert line.startswith(f"error: {path}: F106 ")


@pytest.fixture
def small(tmp_path) -> Path:
    """A folder with a sound file of every format."""
    fuzz.write_files(tmp_path)
    return tmp_path


def _damage(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize("encoding", ["foo", "utf-16", "shift_jis", "punycode", "hex"])
@pytest.mark.parametrize("name", ["loads.xml", "model.osim"])
def test_xml_in_an_encoding_that_it_is_not_in(small, name, encoding):
    _damage(small / name, 'encoding="UTF-8"', f'encoding="{encoding}"')
    forces = [] if name == "model.osim" else [small / "walk.mot", "--loads"]
    marked = [] if name == "model.osim" else [small / "walk.trc"]
    outcome = run("check", *marked, *forces, small / name)
    assert outcome.status == 2
    code = "" if name == "model.osim" else "F103 "
    assert f"{name}, line 1: {code}" in outcome.err


def test_osim_with_elements_without_end(small):
    (small / "model.osim").write_text("<OpenSimDocument>" + 5000 * "<a>" + 5000 * "</a>" + "</OpenSimDocument>")
    outcome = run("check", small / "model.osim")
    assert outcome.status == 2
    assert "more than 200 levels of nested elements" in outcome.err


@pytest.mark.parametrize("version", ["²", "40000²", "٤٠٠٠٠", "9" * 5000])
def test_osim_of_a_version_that_is_no_number(small, version):
    _damage(small / "model.osim", 'Version="40000"', f'Version="{version}"')
    outcome = run("check", small / "model.osim")
    assert outcome.status == 2
    assert "model.osim, line 2: O101 " in outcome.err


@pytest.mark.parametrize("model", here(["synthetic/scaled.osim", "rajagopal_walk/scaled.osim"]))
@pytest.mark.parametrize("frame", range(8))
def test_osim_with_a_renamed_offset_frame(file_of, tmp_path, frame, model):
    text = file_of(model).read_text(encoding="utf-8")
    name = next(name for name in ('name="tibia_r_offset"', 'name="shank_r_offset"') if name in text)
    parts = text.split(name)
    at = 1 + frame % (len(parts) - 1)
    (tmp_path / "model.osim").write_text(name.join(parts[:at]) + 'name="renamed"' + name.join(parts[at:]), "utf-8")
    assert run("check", tmp_path / "model.osim").status in (0, 1, 2)


def test_path_of_a_user_that_is_not_there(small):
    _damage(small / "subject.toml", 'static = "walk.trc"', 'static = "~nouser/x"')
    outcome = run("fit", small / "subject.toml", "-o", small / "out")
    assert outcome.status == 2
    assert "line 8: F101 " in outcome.err


def test_a_coordinate_that_no_laboratory_has(small):
    cells = (small / "walk.trc").read_text(encoding="utf-8").split("\t")
    cells[-4] = "1e12"
    (small / "walk.trc").write_text("\t".join(cells), encoding="utf-8")
    with refused("F171", position_m=1e9, time_s=0.11) as caught:
        read_recording(small / "walk.trc")
    assert caught.value.finding.where.markers == ("RHEE",)


@LINUX
def test_file_names_that_are_not_utf8(small):
    odd = os.fsdecode(os.fsencode(small) + b"/w\xe4lk.trc")
    shutil.copyfile(small / "walk.trc", odd)
    assert run("check", odd, "-o", small / "out").status in (0, 1)
    assert "w?lk: " in (small / "out" / "check.html").read_text(encoding="utf-8")
    (small / "subject.toml").unlink()
    outcome = run("init", small)
    assert outcome.status == 2
    assert "F192 " in outcome.err


@pytest.mark.parametrize("name", [name for name in fuzz.READERS if name != "table.mot"])
def test_fault_free_files_have_neither_errors_nor_warnings(small, name):
    found = getattr(fuzz.READERS[name](small / name), "findings", ())
    assert [finding.code for finding in found if finding.severity >= Severity.WARNING] == []


def test_c3d_file_that_needs_a_process_of_its_own(small):
    """One that contradicts itself where ezc3d does not care is read as if it did not."""
    content = bytearray((small / "walk.c3d").read_bytes())
    at = content.index(b"DATA_START") + 10
    content[at + 5 : at + 7] = b"\x09\x00"  # contradicts the header
    before = read_recording(small / "walk.c3d")
    (small / "walk.c3d").write_bytes(content)
    after = read_recording(small / "walk.c3d")
    assert after.markers.labels == before.markers.labels
    assert (after.markers.positions == before.markers.positions).all()
    assert (after.plates.force == before.plates.force).all()
