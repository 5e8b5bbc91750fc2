"""Laboratories that tests of the command line spoil."""

import shutil

import pytest


@pytest.fixture
def lab(tmp_path, measured_folder):
    """The gait2354 walk under short names, and a C3D walk with its static trial; free to be spoiled."""
    folder = tmp_path / "lab"
    folder.mkdir()
    gait, pig = measured_folder / "gait2354", measured_folder / "pig_c3d"
    for source, name in (
        (gait / "subject01_walk1.trc", "walk.trc"),
        (gait / "subject01_walk1_grf.mot", "walk.mot"),
        (gait / "subject01_walk1_grf.xml", "walk.xml"),
        (gait / "subject01_static.trc", "static.trc"),
        (pig / "subject_a_walk.c3d", "walk.c3d"),
        (pig / "subject_a_static.c3d", "static.c3d"),
    ):
        shutil.copyfile(source, folder / name)
    return folder
