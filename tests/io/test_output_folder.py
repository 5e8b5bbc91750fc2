"""Result folders: complete or not at all, and nobody else's."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest

from kinertia.errors import FileError
from kinertia.io.output_folder import GENERATOR, check_folder, complete_folder, expect_own_folder


@pytest.mark.parametrize("name", ["missing", "empty", "hidden"])
def test_folders_that_hold_nothing(tmp_path, name):
    folder = tmp_path / name
    if name != "missing":
        folder.mkdir()
    if name == "hidden":
        (folder / ".DS_Store").write_text("x")
    expect_own_folder(folder)


@pytest.mark.parametrize(
    ("name", "text", "own"),
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
def test_folders_that_hold_something(tmp_path, name, text, own):
    (tmp_path / name).write_text(text)
    (tmp_path / "other.csv").write_text("1")
    if own:
        expect_own_folder(tmp_path)
        return
    with pytest.raises(FileError, match=f"not results of Kinertia .*{name}.*--force"):
        expect_own_folder(tmp_path)


def test_binary_file_of_that_name_is_somebody_elses(tmp_path):
    (tmp_path / "fit.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError):
        expect_own_folder(tmp_path)


def test_an_error_leaves_nothing(tmp_path):
    def fail():
        with complete_folder(tmp_path / "out") as work:
            (work / "half.txt").write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def results(tmp_path):
    """Results of an earlier run."""
    folder = tmp_path / "out"
    (folder / "walk").mkdir(parents=True)
    for name in ("a.txt", "b.txt", "walk/c.txt"):
        (folder / name).write_text("old", encoding="utf-8")
    return folder


def _write_again(folder):
    with complete_folder(folder) as work:
        (work / "walk").mkdir()
        for name in ("a.txt", "b.txt", "walk/c.txt", "walk/new.txt"):
            (work / name).write_text("new", encoding="utf-8")


def _texts(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in files}


def test_results_are_replaced(results):
    (results / "mine.txt").write_text("mine", encoding="utf-8")
    _write_again(results)
    new = dict.fromkeys(("a.txt", "b.txt", "walk/c.txt", "walk/new.txt"), "new")
    assert _texts(results) == {**new, "mine.txt": "mine"}
    assert [path.name for path in results.parent.iterdir()] == ["out"]


@pytest.mark.parametrize("open_one", ["a.txt", "b.txt", "walk/c.txt"])
def test_a_file_that_is_open_elsewhere_leaves_all_as_it_was(results, monkeypatch, open_one):
    """On Windows nobody can replace a file that Excel or OpenSim has open."""
    before, move = _texts(results), os.replace

    def replace(source, target):
        if results / open_one in (Path(source), Path(target)):
            raise PermissionError(13, "Access is denied", str(source), 5, str(target))
        move(source, target)

    monkeypatch.setattr("kinertia.io.output_folder.os.replace", replace)
    with pytest.raises(FileError, match=rf"{Path(open_one).name}: cannot be replaced .*close the program"):
        _write_again(results)
    assert _texts(results) == before
    assert [path.name for path in results.parent.iterdir()] == ["out"]


def test_a_folder_in_the_way_leaves_all_as_it_was(results):
    (results / "b.txt").unlink()
    (results / "b.txt").mkdir()
    (results / "b.txt" / "mine.txt").write_text("mine", encoding="utf-8")
    before = _texts(results)
    with pytest.raises(FileError, match=r"b.txt: cannot be replaced"):
        _write_again(results)
    assert _texts(results) == before


def test_a_drive_that_is_not_there(monkeypatch, tmp_path):
    monkeypatch.setattr(Path, "exists", lambda path: False)
    with pytest.raises(FileError, match="on a drive or share that is not there"):
        check_folder(tmp_path / "out")


def test_works_outside_the_main_thread(tmp_path):
    def write():
        with complete_folder(tmp_path / "out") as work:
            (work / "a.txt").write_text("a")

    thread = threading.Thread(target=write)
    thread.start()
    thread.join()
    assert (tmp_path / "out" / "a.txt").read_text() == "a"


def test_interruption_while_moving_waits_for_the_last_file(tmp_path):
    """A real SIGINT after the first of 50 files was moved: all arrive, then the interruption counts."""
    code = """
        import os, signal, sys
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from kinertia.io import output_folder as folder
        move, moved = os.replace, []
        def replace(source, target):
            move(source, target)
            moved.append(target)
            if len(moved) == 1:
                os.kill(os.getpid(), signal.SIGINT)
        folder.os.replace = replace
        with folder.complete_folder(sys.argv[1]) as work:
            for k in range(50):
                (work / f"{k}.txt").write_text("x")
    """
    command = [sys.executable, "-c", textwrap.dedent(code), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "KeyboardInterrupt" in done.stderr
    assert done.returncode in (130, -signal.SIGINT)
    assert len(list((tmp_path / "out").iterdir())) == 50
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
