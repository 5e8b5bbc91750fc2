"""Folders to which results may go, and those that are refused before any work."""

import json
from pathlib import Path

import pytest

from kinertia.errors import FileError
from kinertia.io.output_folder import GENERATOR, check_folder, expect_own_folder


@pytest.mark.parametrize("name", ["missing", "empty", ".DS_Store", "desktop.ini", ".gitkeep", ".kinertia-cohort.lock"])
def test_folders_that_hold_nothing(tmp_path, name):
    folder = tmp_path / "out"
    if name != "missing":
        folder.mkdir()
    if name not in ("missing", "empty"):
        (folder / name).write_text("x")
    expect_own_folder(folder)


def test_hidden_files_are_somebody_elses_and_no_folder_inside_is_looked_at(tmp_path, monkeypatch):
    (tmp_path / ".ssh").mkdir()
    (tmp_path / ".profile").write_text("x")
    monkeypatch.delattr(Path, "rglob")
    with pytest.raises(FileError, match=r"not results of Kinertia \(.profile, .ssh\); give another folder$"):
        expect_own_folder(tmp_path)
    (tmp_path / ".kinertia.json").write_text("{}")
    expect_own_folder(tmp_path)


def test_the_home_folder_is_refused_at_once(tmp_path, monkeypatch):
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.delattr(Path, "rglob")
    for refused in (check_folder, expect_own_folder):
        with pytest.raises(FileError, match=r"is your home folder, .*give a folder inside it"):
            refused(tmp_path)


@pytest.mark.parametrize(
    ("name", "text", "is_results"),
    [
        ("fit.json", json.dumps({"kinertia": "0.1.0"}), True),
        ("table1.json", json.dumps({"kinertia": "0.1.0"}), True),
        ("check.html", f'<!doctype html><html><head>{GENERATOR} 0.1.0"></head>', True),
        ("fit.json", json.dumps({"name": "sklearn"}), False),
        ("fit.json", json.dumps(["kinertia"]), False),
        ("fit.json", "kinertia", False),
        ("check.html", "<html>kinertia</html>", False),
        ("thesis.tex", "kinertia", False),
    ],
)
def test_folders_that_hold_something(tmp_path, name, text, is_results):
    (tmp_path / name).write_text(text)
    (tmp_path / "other.csv").write_text("1")
    if is_results:
        expect_own_folder(tmp_path)
        return
    with pytest.raises(FileError, match=f"not results of Kinertia .*{name}.* folder, or so$"):
        expect_own_folder(tmp_path, ", or so")


def test_binary_file_of_that_name_is_somebody_elses(tmp_path):
    (tmp_path / "fit.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError):
        expect_own_folder(tmp_path)


def test_a_folder_without_permission_is_refused_without_advice_that_cannot_work(results, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: Path(path) != results)
    with pytest.raises(FileError, match=r"cannot be written to; give another folder for the results$"):
        check_folder(results)


def test_a_folder_in_a_file_s_place_is_refused_before_any_work(results):
    (results / "report.html").mkdir()
    with pytest.raises(FileError, match=r"report.html: is a folder where a file"):
        check_folder(results)


def test_a_file_in_a_folder_s_place_is_refused_before_any_work(results):
    (results / "walk2").write_text("mine", encoding="utf-8")
    check_folder(results)
    with pytest.raises(FileError, match=r"walk2: is a file where a folder"):
        check_folder(results, ["walk1", "walk2"])


def test_a_file_that_a_result_would_replace_is_refused_before_any_work(results):
    (results / "model.osim").write_text("mine", encoding="utf-8")
    check_folder(results, files=["fit.json"])
    with pytest.raises(FileError, match=r"model\.osim: is a file of yours"):
        check_folder(results, files=["fit.json", "model.osim"])


@pytest.mark.parametrize("place", ["", "walk"])
def test_the_current_folder_cannot_be_replaced(results, monkeypatch, place):
    monkeypatch.chdir(results / place)
    with pytest.raises(FileError, match=r"current folder.*give a folder inside it"):
        check_folder(results)


def test_a_mounted_folder_cannot_be_replaced(results, monkeypatch):
    monkeypatch.setattr("os.path.ismount", lambda path: Path(path) == results)
    with pytest.raises(FileError, match=r"mounted folder.*give a folder inside it"):
        check_folder(results)


def test_a_drive_that_is_not_there(monkeypatch, tmp_path):
    monkeypatch.setattr(Path, "exists", lambda path: False)
    with pytest.raises(FileError, match="on a drive or share that is not there"):
        check_folder(tmp_path / "out")
