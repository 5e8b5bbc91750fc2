"""`kinertia fit` of several people; values as people write them, results as scripts read them; shell completion."""

import json
import shutil
from dataclasses import replace

import pytest

from command_line import run, run_apart
from kinertia.errors import BlockedError, FileError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Quantity, Where


@pytest.fixture
def subjects(demo_run, tmp_path, monkeypatch, fit):
    """Folder of the demo's files with two subject files, whose fits are those of the demo and take no time."""
    folder = tmp_path / "lab"
    shutil.copytree(demo_run[0].subject_file.parent, folder)
    for name in ("anna.toml", "ben.toml"):
        shutil.copy(demo_run[0].subject_file, folder / name)
    monkeypatch.setattr("kinertia.cli.fit.fit_subject", lambda wanted, *_: replace(fit, subject=wanted.subject))
    return folder


@pytest.mark.slow
def test_several_people_are_fitted_each_into_a_folder_of_their_own(subjects, tmp_path):
    out = tmp_path / "out"
    outcome = run("fit", subjects / "anna.toml", subjects / "ben.toml", "-o", out, "--json")
    assert outcome.status in (0, 1), outcome.err
    anna, ben = json.loads(outcome.out)
    assert [anna["folder"], ben["folder"]] == [str(out / "anna"), str(out / "ben")]
    for name, summary in (("anna", anna), ("ben", ben)):
        written = json.loads((out / name / "fit.json").read_text())
        assert {key: value for key, value in summary.items() if key not in ("folder", "bsp")} == written
        assert f"{subjects / name}.toml -o {out / name}" in (out / name / "report.html").read_text()
    only = json.loads(run("fit", subjects / "anna.toml", "-o", tmp_path / "one", "--json").out)
    assert only["folder"] == str(tmp_path / "one")
    assert only["trials"] == anna["trials"]
    shown = run("fit", subjects / "anna.toml", subjects, "-o", out).out
    assert f"results in {out / 'anna'}" in shown
    assert f"results in {out / 'lab'}" in shown  # subject.toml is called like its folder


def test_an_error_of_one_person_does_not_keep_the_others_from_being_fitted(subjects, tmp_path, monkeypatch, fit):
    def fitted_or_not(wanted, progress, overrule):
        if wanted.subject.mass_kg == 60.0:
            raise FileError(subjects / "walk.trc", "is of somebody else")
        return fit

    monkeypatch.setattr("kinertia.cli.fit.fit_subject", fitted_or_not)
    text = (subjects / "anna.toml").read_text()
    (subjects / "anna.toml").write_text(text.replace("72.6", "60.0"))
    outcome = run("fit", subjects / "anna.toml", subjects / "ben.toml", "-o", tmp_path / "out", "--quiet")
    assert outcome.status == 2
    assert "anna.toml" in outcome.err
    assert "is of somebody else" in outcome.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"ben"}


def test_every_finding_that_blocks_one_of_several_people_is_a_line(subjects, tmp_path, monkeypatch, fit):
    found = [finding("P271", Where(trial=trial), left_out=Quantity("none")) for trial in ("early", "late")]

    def fitted_or_not(wanted, progress, overrule):
        if wanted.subject.mass_kg == 60.0:
            raise BlockedError(found, found)
        return fit

    monkeypatch.setattr("kinertia.cli.fit.fit_subject", fitted_or_not)
    anna, text = subjects / "anna.toml", (subjects / "anna.toml").read_text()
    anna.write_text(text.replace("72.6", "60.0"))
    outcome = run("fit", anna, subjects / "ben.toml", "-o", tmp_path / "out", "--json")
    assert outcome.status == 2
    lines = [line for line in outcome.err.splitlines() if line.startswith("error: ")]
    assert [
        line.startswith(f"error: {anna}: {reported.line()}") for line, reported in zip(lines, found, strict=True)
    ] == [True] * 2
    blocked, ben = json.loads(outcome.out)
    assert ([reported["code"] for reported in blocked["findings"]], blocked["folder"]) == (["P271", "P271"], None)
    assert ben["folder"] == str(tmp_path / "out" / "ben")


def test_several_people_need_subject_files_of_different_names(subjects, tmp_path):
    (subjects / "more").mkdir()
    shutil.copy(subjects / "anna.toml", subjects / "more")
    walk = subjects / "walk.trc"
    for wrong, words in (
        ((subjects / "anna.toml", walk), "walk.trc: is not a subject file"),
        ((subjects / "anna.toml", subjects / "nobody.toml"), "nobody.toml: F101 "),
    ):
        outcome = run("fit", *wrong, "-o", tmp_path / "out")
        assert (outcome.status, words in outcome.err) == (2, True), outcome.err
    (subjects / "more" / "anna.toml").write_text((subjects / "anna.toml").read_text())
    outcome = run("fit", subjects / "anna.toml", subjects / "more" / "anna.toml", "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "its results would go to anna, as those of" in outcome.err
    assert not (tmp_path / "out").exists()


def test_numbers_and_sex_as_people_write_them(subjects, tmp_path):
    walk, forces = subjects / "walk.trc", subjects / "walk_grf.mot"
    given = ("fit", walk, "--forces", forces, "--static", subjects / "static.trc")
    outcome = run(*given, "--mass", "72,6", "--height", "1,803", "--sex", "M", "-o", tmp_path / "out", "--json")
    assert outcome.status in (0, 1), outcome.err
    subject = json.loads(outcome.out)["subject"]
    assert (subject["mass_kg"], subject["height_m"], subject["sex"]) == (72.6, 1.803, "male")
    for option, text, words in (
        ("--mass", "72.6kg", "'72.6kg' is not a number"),
        ("--mass", "1.072,6", "'1.072,6' is not a number"),
        ("--sex", "x", "neither male (m) nor female (f)"),
    ):
        outcome = run("check", walk, option, text)
        assert outcome.status == 2
        assert words in " ".join(outcome.err.replace("│", " ").split())
    wrong = subjects / "ben.toml"
    wrong.write_text(wrong.read_text().replace("72.6", "72,6"))
    outcome = run("fit", wrong, "-o", tmp_path / "out")
    assert "a decimal point, not a comma: 72.6" in outcome.err


@pytest.mark.slow
def test_shells_complete_commands_and_options():
    for typed, expected in (("kinertia com", "compare"), ("kinertia report --no", "--norms")):
        words = {"_KINERTIA_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
        done = run_apart(**words)
        assert done.out.split() == [expected], done.err
