"""Results that replace earlier ones: all of them, and nobody else's files."""

import os
import threading
from pathlib import Path

import pytest

from kinertia.errors import FileError
from kinertia.io.output_folder import complete_folder, put_in_place, updated_files
from result_files import texts_of, write


def _write_again(folder):
    write(folder, "new", "a.txt", "walk/c.txt", "walk/new.txt")


NEW = dict.fromkeys(("a.txt", "walk/c.txt", "walk/new.txt"), "new")


def test_results_are_replaced_by_all_and_nothing_but_the_new_ones(results):
    """`b.txt`, which the new run has no use for, would stand beside numbers that it does not belong to."""
    _write_again(results)
    assert texts_of(results) == NEW
    assert [path.name for path in results.parent.iterdir()] == ["out"]


def test_what_others_wrote_stays(results):
    (results / "mine.txt").write_text("mine", encoding="utf-8")
    (results / "walk" / "mine.txt").write_text("mine", encoding="utf-8")
    (results / "link").symlink_to("mine.txt")
    _write_again(results)
    assert texts_of(results) == {**NEW, "mine.txt": "mine", "walk/mine.txt": "mine", "link": "mine"}
    assert (results / "link").is_symlink()
    assert [path.name for path in results.parent.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["walk.c3d", "walk/model.osim"])
@pytest.mark.parametrize("among", ["results", "recordings"])
def test_a_file_of_the_users_is_never_replaced_by_a_result_of_its_name(results, among, name):
    """A recording in the folder that its export would go to, a model of one's own: nothing could bring them back."""
    if among == "recordings":
        (results / ".kinertia.json").unlink()
    (results / name).write_text("mine", encoding="utf-8")
    before = texts_of(results)
    with pytest.raises(FileError, match=rf"{Path(name).name}: is a file of yours .*give another folder"):
        write(results, "new", "new.txt", name, kind="export")
    assert texts_of(results) == before
    (results / name).unlink()
    if among == "results":
        write(results, "new", name, kind="export")
        write(results, "newer", name, kind="export")
        assert texts_of(results)[name] == "newer"


def test_results_without_their_hidden_list_are_replaced(results):
    """Copied by a program that passes over hidden files."""
    (results / ".kinertia.json").unlink()
    (results / "fit.json").write_text('{"kinertia": "0.1.0"}', encoding="utf-8")
    _write_again(results)
    assert texts_of(results)["a.txt"] == "new"


def test_a_file_system_without_links_and_exchange(results, monkeypatch):
    """Windows' FAT: copies, and two steps."""

    def no_link(*arguments, **options):
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr("kinertia.io.output_folder.os.link", no_link)
    monkeypatch.setattr("kinertia.io.output_folder._exchanged", lambda first, other: False)
    (results / "mine.txt").write_text("mine", encoding="utf-8")
    _write_again(results)
    assert texts_of(results) == {**NEW, "mine.txt": "mine"}
    assert [path.name for path in results.parent.iterdir()] == ["out"]


def test_a_file_that_comes_while_folders_are_exchanged_is_kept(results, monkeypatch):
    def late(new, folder, aside):
        (folder / "late").mkdir()
        (folder / "late" / "mine.txt").write_text("mine", encoding="utf-8")
        return put_in_place(new, folder, aside)

    monkeypatch.setattr("kinertia.io.output_folder.put_in_place", late)
    _write_again(results)
    assert texts_of(results) == {**NEW, "late/mine.txt": "mine"}


def test_results_of_other_kinds_stay(results):
    write(results, "page", "check.html", kind="check")
    _write_again(results)
    assert texts_of(results) == {**NEW, "check.html": "page"}
    write(results, "again", "check.html", kind="check")
    assert texts_of(results) == {**NEW, "check.html": "again"}


def test_files_that_results_get_later_go_with_them(results):
    """Scores by norms, which a report adds, are not left beside the next fit."""
    with updated_files(results, "fit", ["gps.csv"]) as work:
        (work / "gps.csv").write_text("scores", encoding="utf-8")
    (results / "mine.csv").write_text("mine", encoding="utf-8")
    assert texts_of(results)["gps.csv"] == "scores"
    _write_again(results)
    assert texts_of(results) == {**NEW, "mine.csv": "mine"}


def test_an_optional_file_is_removed_only_where_an_update_wrote_it(results):
    (results / "gps.csv").write_text("mine", encoding="utf-8")
    after = []
    for name in ("report.html", "gps.csv", "report.html"):
        with updated_files(results, "fit", ["gps.csv"]) as work:
            (work / name).write_text("new", encoding="utf-8")
        after.append(texts_of(results).get("gps.csv"))
    assert after == ["mine", "new", None]


def test_results_within_results(tmp_path):
    """As the demo has them: its fit is replaced by the next fit, its other files stay."""
    with complete_folder(tmp_path / "out", "demo") as work:
        write(work, "old", "fit.json", "sd.sto")
        (work / "truth.csv").write_text("truth", encoding="utf-8")
    write(tmp_path / "out", "new", "fit.json")
    assert texts_of(tmp_path / "out") == {"fit.json": "new", "truth.csv": "truth"}


def test_folders_that_a_link_leads_to(results):
    (results.parent / "there").symlink_to("out")
    _write_again(results.parent / "there")
    assert texts_of(results) == NEW
    assert (results.parent / "there").is_symlink()


def _busy(monkeypatch, step):
    """The system refuses the given rename, the first being number 0."""
    rename, done = os.rename, []

    def renamed(source, target):
        done.append(target)
        if len(done) == step + 1:
            raise PermissionError(13, "Access is denied", str(source), 5, str(target))
        rename(source, target)

    monkeypatch.setattr("kinertia.io.output_folder.os.rename", renamed)
    monkeypatch.setattr("kinertia.io.output_folder._exchanged", lambda first, other: False)


@pytest.mark.parametrize("step", [0, 1])
def test_a_folder_that_another_program_holds_stays_as_it_was(results, monkeypatch, step):
    """On Windows nobody can move a folder with a file that Excel or OpenSim has open."""
    before = texts_of(results)
    _busy(monkeypatch, step)
    with pytest.raises(FileError, match=r"out: cannot be replaced \(Access is denied\).*close the program"):
        _write_again(results)
    assert texts_of(results) == before
    assert [path.name for path in results.parent.iterdir()] == ["out"]


def test_works_outside_the_main_thread(tmp_path):
    thread = threading.Thread(target=write, args=(tmp_path / "out", "a", "a.txt"))
    thread.start()
    thread.join()
    assert (tmp_path / "out" / "a.txt").read_text() == "a"
