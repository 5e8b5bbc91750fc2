"""Names that Windows forbids, and paths written on Windows."""

import pytest

from kinertia.errors import missing_file
from kinertia.io.file_names import fits_everywhere, path_from, same_folder


@pytest.mark.parametrize(
    "name",
    ["CON", "con", "PRN", "aux", "NUL", "nul.walk", "nul .walk", "COM1", "lpt9", "COM²", "walk.", "walk ", "", "a:b"]
    + [f"walk{letter}1" for letter in '<>:"/\\|?*\t\0'],
)
def test_names_that_a_folder_cannot_have(name):
    assert not fits_everywhere(name)


@pytest.mark.parametrize(
    "name", ["walk 1", "console", "aux1", "COM", "com10", "null", "Müller", "a.b", ".walk", "歩行"]
)
def test_names_that_a_folder_can_have(name):
    assert fits_everywhere(name)


def test_names_of_one_folder():
    assert same_folder("Walk", "walk")
    assert same_folder("M\u00fcller", "Mu\u0308ller")
    assert not same_folder("walk 1", "walk 2")


def test_backslashes_are_separators(tmp_path):
    (tmp_path / "day 1").mkdir()
    (tmp_path / "day 1" / "walk.trc").touch()
    assert path_from(tmp_path, r"day 1\walk.trc") == tmp_path / "day 1" / "walk.trc"
    assert path_from(tmp_path, "day 1/walk.trc") == tmp_path / "day 1" / "walk.trc"


def test_a_name_in_other_letters_is_the_nearest(tmp_path):
    for name in ("WALK.TRC", "static.trc"):
        (tmp_path / name).touch()
    assert missing_file(tmp_path / "walk.trc", "walk.trc")["nearest"].value.startswith("WALK.TRC")


def test_a_folder_that_is_missing_is_near_to_no_file(tmp_path):
    (tmp_path / "exp_csv").write_text("")
    assert "nearest" not in missing_file(tmp_path / "exp", "exp", "a folder", is_folder=True)
    assert missing_file(tmp_path / "exp", "exp")["nearest"].value == "exp_csv"
    (tmp_path / "export").mkdir()
    assert missing_file(tmp_path / "exp", "exp", "a folder", is_folder=True)["nearest"].value == "export"
