"""`kinertia init`: the drafted file, and what it leaves alone."""

import re
import shutil

import pytest

from command_line import fitted, run
from kinertia.io.subject.provenance import command_line


@pytest.mark.slow
@pytest.mark.usefixtures("few_evaluations")
def test_init_then_fill_in_then_fit(person):
    """The drafted file says what is missing; with that filled in and a shorter window it runs as it is."""
    drafted = run("init", person)
    path = person / "subject.toml"
    assert drafted.status == 0
    assert f"wrote {path}" in drafted.out
    refusal = run("fit", path, "-o", person / "out")
    assert refusal.status == 2
    assert re.search(r"subject\.toml, line \d+: F191 .*\[subject\] lacks 'sex'", refusal.err)
    text = path.read_text()
    assert text.count("# sex = ") == 1
    text = re.sub(r'# sex = "\w+"', 'sex = "male"', text).replace("[[trial]]", "[[trial]]\nwindow_s = [1.2, 1.45]")
    path.write_text(text)
    fit = fitted(person / "out", path)
    assert fit.summary["subject"]["name"] == "anna [b]"
    assert fit.summary["subject"]["mass_kg"] == pytest.approx(72.6, abs=0.1)
    assert fit.trial["window_s"] == pytest.approx([1.2, 1.45])
    assert f"results in {fit.folder}" in fit.outcome.out


def test_init_leaves_an_existing_file_alone(person):
    (person / "subject.toml").write_text("mine")
    outcome = run("init", person)
    assert outcome.status == 2
    assert "already exists" in outcome.err
    assert (person / "subject.toml").read_text() == "mine"


def test_commands_of_a_folder_with_a_space_can_be_typed_as_shown(tmp_path, c3d_lab):
    folder = tmp_path / "Anna Müller"
    folder.mkdir()
    shutil.copyfile(c3d_lab / "static.c3d", folder / "static.c3d")
    shutil.copyfile(c3d_lab / "walk.c3d", folder / "walk.c3d")
    drafted = run("init", folder)
    assert command_line(["kinertia", "check", str(folder / "subject.toml")]) in drafted.out
    assert command_line(["kinertia", "init", str(folder)]) in run("init", folder, "--measures").out


def test_init_without_recordings(tmp_path):
    outcome = run("init", tmp_path)
    assert (outcome.status, outcome.err.count("\n")) == (2, 1)
    assert list(tmp_path.iterdir()) == []
