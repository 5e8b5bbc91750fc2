"""`kinertia norms`, and the report with them."""

import csv
import json
import shutil
from dataclasses import replace

import pandas as pd
import pytest

from command_line import run
from kinertia.cli.report import score_text
from kinertia.estimation.drawn_fit import drawn_fit
from kinertia.io.norms_file import read_norms
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit
from report_page import figures_of


@pytest.fixture(scope="module")
def controls(fit, tmp_path_factory):
    """Three people, alike as draws from one posterior are."""
    folder = tmp_path_factory.mktemp("controls")
    for number, name in enumerate(("anna", "ben", "cleo")):
        (folder / name).mkdir()
        subject = fit.subject.model_copy(update={"name": name, "age_years": 20.0 + 10.0 * number})
        write_fit(replace(drawn_fit(fit, number), subject=subject), None, folder / name / FIT_FILE)
    return folder


def test_norms_and_scores(fit, demo_run, controls, tmp_path):
    file = tmp_path / "norms.csv"
    outcome = run("norms", controls, "-o", file)
    assert outcome.status == 0, outcome.err
    assert "norms of 3 people (20 to 40 years, " in outcome.out
    table = pd.read_csv(file)
    assert set(table.convention) == {"Kinertia gait27"}
    assert (table.n.max(), table.age_years_min[0], table.age_years_max[0]) == (3, 20.0, 40.0)
    assert {"foot_progression_clinical", "knee_angle_moment", "ground_force_upward"} <= set(table.quantity)
    norm = read_norms(file)["knee_angle_angle"]
    assert (norm.people, norm.convention, norm.age_years) == (3, "Kinertia gait27", (20.0, 40.0))
    assert "norms mix" not in outcome.out
    results = tmp_path / "out"
    results.mkdir()
    shutil.copy(demo_run[1] / FIT_FILE, results)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 0, outcome.err
    assert "Gait Profile Score" in outcome.out
    notes = [line for line in outcome.out.splitlines() if line.startswith("note: ")]
    assert all("years" in line or "m/s" in line or "Age" in line for line in notes)
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "Gait Profile Score" in page
    assert "norm, right" in json.dumps(figures_of(page), default=str)
    scores = list(csv.DictReader((results / "gps.csv").open(encoding="utf-8")))
    assert len(scores) == 21
    cycles = pd.read_csv(results / "cycles.csv")
    pd.testing.assert_frame_equal(fit.cycles(norms=file), cycles, rtol=1e-4, check_dtype=False)
    pd.testing.assert_frame_equal(fit.gps(file).table, pd.read_csv(results / "gps.csv"), rtol=1e-4, check_dtype=False)
    assert run("report", results).status == 0
    assert not (results / "gps.csv").exists(), "scores of norms that the report no longer has"
    pd.testing.assert_frame_equal(fit.cycles(), pd.read_csv(results / "cycles.csv"), rtol=1e-4, check_dtype=False)


def test_one_folder_per_person(controls, tmp_path):
    outcome = run("norms", controls / "anna", controls, "-o", tmp_path / "n.csv")
    assert outcome.status == 0, "the same folder twice counts once"
    shutil.copytree(controls / "anna", tmp_path / "again")
    outcome = run("norms", controls, tmp_path / "again", "-o", tmp_path / "n.csv")
    assert outcome.status == 2
    assert "is a second fit of anna" in " ".join(outcome.err.split())


def test_people_whose_fits_are_named_after_their_trials_are_told_by_their_folders(fit, tmp_path):
    """Each child's trial is called "straight", and so is the fit."""
    for number, name in enumerate(("HC030A", "HC032A")):
        drawn = drawn_fit(fit, number)
        (tmp_path / name).mkdir()
        subject = fit.subject.model_copy(update={"name": drawn.trials[0].name})
        write_fit(replace(drawn, subject=subject), None, tmp_path / name / FIT_FILE)
    outcome = run("norms", tmp_path / "HC030A", tmp_path / "HC032A", "-o", tmp_path / "n.csv", "--json")
    assert json.loads(outcome.out)["people"] == ["HC030A", "HC032A"], outcome.err


def test_too_few_people_and_other_files_are_refused(controls, tmp_path):
    outcome = run("norms", controls / "anna", "-o", tmp_path / "n.csv")
    assert outcome.status == 2
    assert "at least 2 different people" in outcome.err
    assert not (tmp_path / "n.csv").exists()
    other = tmp_path / "mine.csv"
    other.write_text("a,b\n1,2\n")
    outcome = run("norms", controls, "-o", other)
    assert outcome.status == 2
    assert other.read_text() == "a,b\n1,2\n"


def test_norms_of_another_model_are_refused(demo_run, controls, tmp_path):
    file, results = tmp_path / "norms.csv", tmp_path / "out"
    assert run("norms", controls, "-o", file).status == 0
    file.write_text(file.read_text().replace("Kinertia gait27", "Plug-in Gait"))
    results.mkdir()
    shutil.copy(demo_run[1] / FIT_FILE, results)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 2
    assert "the norms are of Plug-in Gait" in " ".join(outcome.err.split())
    assert not (results / "report.html").exists()


def test_a_score_that_does_not_exist_is_not_printed_as_a_number():
    assert score_text(7.96) == "8.0 degrees"
    assert "nan" not in score_text(float("nan"))
