"""The folder in which subject files of tests are."""

import pytest


@pytest.fixture
def folder(tmp_path):
    root = tmp_path / "anna"
    (root / "data").mkdir(parents=True)
    for name in (
        "static.trc",
        "data/walk1.trc",
        "data/walk1.mot",
        "data/walk1.xml",
        "data/walk2.c3d",
        "my.toml",
    ):
        (root / name).touch()
    return root
