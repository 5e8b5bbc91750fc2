"""Laboratories that tests of the command line spoil, and a terminal that every test finds as a user does."""

import shutil

import pytest

from kinertia.cli import common


@pytest.fixture(autouse=True)
def not_quiet(monkeypatch):
    """No test is quiet because the command of an earlier one was: in use, each command is a process of its own."""
    monkeypatch.setattr(common.out, "quiet", False)


@pytest.fixture
def lab(tmp_path, synthetic_lab):
    """A walk in TRC and MOT under short names, and a C3D walk, each with its static trial; free to be spoiled."""
    folder = tmp_path / "lab"
    folder.mkdir()
    for name in ("walk.trc", "static.trc", "walk.c3d", "static.c3d"):
        shutil.copyfile(synthetic_lab / name, folder / name)
    for kind in ("mot", "xml"):
        shutil.copyfile(synthetic_lab / f"walk_grf.{kind}", folder / f"walk.{kind}")
    return folder


@pytest.fixture
def person(tmp_path, c3d_lab):
    """A folder with the two C3D files of one person."""
    folder = tmp_path / "anna [b]"
    folder.mkdir()
    for kind in ("walk", "static"):
        shutil.copyfile(c3d_lab / f"{kind}.c3d", folder / f"{kind}.c3d")
    return folder
