import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import study_results
from command_line import run
from kinertia.report.pages.table1 import save_table1, table1_frame, table1_rows
from kinertia.studies.table1 import CONDITIONS, study_trial


@pytest.fixture
def table():
    return study_results.table1()


def test_frame_has_ours_and_the_published(table):
    frame = table1_frame(table)
    assert len(frame) == 10
    for condition in CONDITIONS:
        np.testing.assert_allclose(frame[f"{condition}_mean"], 3 * frame[f"{condition}_published"])
        np.testing.assert_allclose(frame[f"{condition}_sd"], np.sqrt(2) * frame[f"{condition}_published"])
    mass = frame[(frame["quantity"] == "mass (kg)") & (frame["statistic"] == "max")]
    assert mass["no_correction_noise_published"].item() == 5.77


def test_rows_fit_a_terminal_of_100_columns(table):
    rows = table1_rows(table)
    assert len(rows) == 15
    assert rows[0][0] == "inertia (kg m2)"
    assert rows[2][0].strip() == "published"
    assert rows[2][1] == "2.67e-5 / 5.65e-5"
    assert sum(max(len(row[k]) for row in rows) + 1 for k in range(5)) + 3 <= 100


@pytest.mark.slow
def test_four_files_are_written(table, tmp_path):
    folder = save_table1(table, tmp_path / "deep" / "out")
    names = sorted(path.name for path in folder.glob("[!.]*"))
    assert names == ["report.html", "table1.csv", "table1.json", "table1.png"]
    assert json.loads((folder / "table1.json").read_text())["seed"] == 3
    assert pd.read_csv(folder / "table1.csv").shape == (10, 2 + 12)
    page = (folder / "report.html").read_text()
    assert "walk &lt;1&gt;" in page
    assert "<svg" in page
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    )
    assert (folder / "table1.png").read_bytes()[:4] == b"\x89PNG"
    assert [path.name for path in folder.parent.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--repeats", "0"), "repeats"),
        (("--seed", "-1"), "seed"),
        (("--trial", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_bad_arguments_end_with_status_2_and_no_folder(tmp_path, arguments, words):
    outcome = run("study", "table1", *arguments, "-o", tmp_path / "out")
    assert outcome.status == 2
    assert words in outcome.err
    assert "Traceback" not in outcome.err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_command_prints_and_writes(table, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    asked = {}

    def given(trial, repeats, seed, name, progress):
        asked.update(repeats=repeats, seed=seed, frames=len(trial.time))
        progress(1.0)
        return replace(table, seed=seed)

    monkeypatch.setattr("kinertia.cli.studies.run_table1", given)
    outcome = run("study", "table1", "--repeats", 2, "--seed", 9, "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert asked == {"repeats": 2, "seed": 9, "frames": len(study_trial().time)}
    assert "published" in outcome.out
    assert json.loads((tmp_path / "out" / "table1.json").read_text())["seed"] == 9


def test_table1_without_matplotlib_has_everything_but_the_picture(table, without, tmp_path):
    without("matplotlib")
    folder = save_table1(table, tmp_path / "out")
    assert sorted(path.name for path in folder.glob("[!.]*")) == ["report.html", "table1.csv", "table1.json"]
    assert 'id="segments"' not in (folder / "report.html").read_text(encoding="utf-8")
