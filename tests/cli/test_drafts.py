"""`kinertia init`: the drafted file, and what it leaves alone."""

import json
import re
import shutil

import pytest
import typer

from command_line import fitted, run
from generic_static import recording, standing_positions
from kinertia.cli import drafts
from kinertia.io.file_names import command_line
from kinertia.io.marker_set_file import read_marker_set
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.trc import write_trc


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


def written(path, positions):
    write_trc(path, recording(positions, frames=30).markers)
    return path


def test_a_preset_whose_landmarks_a_static_trial_lacks_is_said_to_lack_them(tmp_path):
    names = {"R.Knee.Med": "R.Innen", "L.Knee.Med": "L.Innen"}
    positions = {names.get(label, label): at for label, at in standing_positions().items()}
    shown = run("markers", written(tmp_path / "static.trc", positions)).out
    assert "cleveland-clinic is recognised by itself" in shown
    assert "but this static trial lacks some of its landmarks" in shown
    complete = run("markers", written(tmp_path / "complete.trc", standing_positions())).out
    assert "lacks landmarks" not in complete


def test_a_draft_is_a_marker_set_and_says_what_it_lacks(tmp_path):
    positions = {label: at for label, at in standing_positions().items() if label != "R.Heel"}
    file, draft = written(tmp_path / "static.trc", positions), tmp_path / "own.toml"
    outcome = run("markers", file, "-o", draft)
    assert "not found, and needed: heel_r" in outcome.out
    assert read_marker_set(draft).landmarks["heel_l"] == ("L.Heel",)
    assert run("markers", file, "-o", draft).status == 2, "what is there is left alone"
    content = json.loads(run("markers", file, "-o", tmp_path / "other.toml", "--json").out)
    assert (content["needed"], content["notes"]) == (["heel_r"], [])


def with_two_walks(folder, lab):
    for name, source in {"static": "static", "walk1": "walk", "walk2": "walk"}.items():
        shutil.copyfile(lab / f"{source}.c3d", folder / f"{name}.c3d")
    return folder


def test_init_writes_what_options_state_and_asks_nothing_without_a_terminal(tmp_path, c3d_lab):
    folder = with_two_walks(tmp_path, c3d_lab)
    outcome = run("init", folder, "--sex", "f", "--age", "9,5", "--mass", "31", "--condition", "walk2=with orthosis")
    assert outcome.status == 0
    wanted = read_subject(folder / "subject.toml")
    stated = wanted.subject
    assert (stated.sex, stated.age_years, stated.mass_kg) == ("female", 9.5, 31.0)
    assert {trial.name: trial.condition for trial in wanted.trials} == {"walk1": "", "walk2": "with orthosis"}


@pytest.mark.parametrize("given", ["walk2", "=x", "walk3=barefoot"])
def test_init_refuses_a_condition_of_no_trial(tmp_path, c3d_lab, given):
    folder = with_two_walks(tmp_path, c3d_lab)
    assert run("init", folder, "--condition", given).status == 2
    assert not (folder / "subject.toml").exists()


def test_init_asks_in_a_terminal_for_what_is_not_known(tmp_path, c3d_lab, monkeypatch):
    folder = with_two_walks(tmp_path, c3d_lab)
    answers = {"Sex, male or female (m, f)": ["x", "m"], "Age, years": ["52"], "Condition of walk2": ["barefoot"]}
    monkeypatch.setattr(drafts, "_in_terminal", lambda: True)
    monkeypatch.setattr(typer, "prompt", lambda question, **_: answers.get(question, [""]).pop(0))
    outcome = run("init", folder, "--mass", "72.6", "--height", "1.8")
    assert outcome.status == 0
    assert "Trials: walk1, walk2." in outcome.out
    assert "now run: kinertia check" in " ".join(outcome.out.split()), "nothing is left to fill in"
    wanted = read_subject(folder / "subject.toml")
    assert (wanted.subject.sex, wanted.subject.age_years, wanted.subject.mass_kg) == ("male", 52.0, 72.6)
    assert {trial.name: trial.condition for trial in wanted.trials} == {"walk1": "", "walk2": "barefoot"}


def test_a_stature_in_centimetres_is_asked_again(monkeypatch, capsys):
    answers = ["168", "1,68"]
    monkeypatch.setattr(typer, "prompt", lambda question, **_: answers.pop(0))
    assert drafts._asked({"sex": "male", "age_years": 52.0, "mass_kg": 72.6}) == {"height_m": 1.68}
    assert "168 is not between 0.5 and 2.5 m" in capsys.readouterr().out
