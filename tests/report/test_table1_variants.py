import pandas as pd
import pytest

import study_results
from command_line import run
from kinertia.report.pages.table1 import HEADINGS, save_variants, variants_frame, variants_rows
from kinertia.studies.table1_variants import LONG, LONG_GROUND, NOISY


@pytest.fixture
def tables():
    return study_results.variants()


def test_rows_have_the_published_first(tables):
    rows = variants_rows(tables)
    assert [len(row) for row in rows] == [len(HEADINGS)] * 3
    published, pelvis, ground = rows
    assert published[2] == "0.93 / 0.38"
    assert published[-2] == "2.7e-5 / 2.7e-5"
    assert pelvis[:2] == [LONG, "2"]
    assert pelvis[2:5] == ["2.8 / 1.1", "6.3 / 5.1", "0.59 / 0.54"]
    assert pelvis[-3:] == ["100, 100, 100", "5.3e-5 / 5.5e-5", "3.00"]
    assert ground[0] == LONG_GROUND


def test_frame_has_every_draw(tables):
    frame = variants_frame(tables)
    assert len(frame) == 2 * (4 + 2)
    rows = frame[(frame["variant"] == LONG_GROUND) & (frame["draw"] == 1) & (frame["condition"] == "correction_noise")]
    assert rows["mass_rms_kg"].item() == 4 * 1.71
    assert rows["iterations"].item() == 3
    assert set(frame[~frame["condition"].isin(NOISY)]["draw"]) == {0}


@pytest.mark.slow
def test_files_are_written(tables, without, tmp_path):
    folder = save_variants(tables, tmp_path / "out")
    assert sorted(path.name for path in folder.glob("variants*")) == [
        "variants.csv",
        "variants.html",
        "variants.md",
        "variants.png",
    ]
    assert "<svg" in (folder / "variants.html").read_text(encoding="utf-8")
    assert len((folder / "variants.md").read_text(encoding="utf-8").splitlines()) == 2 + 3
    assert pd.read_csv(folder / "variants.csv").shape == (12, 4 + 10)
    without("matplotlib")
    assert not (save_variants(tables, tmp_path / "again") / "variants.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("measured", [False, True])
def test_command_prints_and_writes(tables, measured, tmp_path, monkeypatch):
    asked = {}

    def given(trial, repeats, seed, progress):
        asked.update(trial=trial, repeats=repeats, seed=seed)
        progress(1.0)
        return tables

    monkeypatch.setattr("kinertia.cli.studies.run_variants", given)
    monkeypatch.setattr("kinertia.cli.studies.read_subject", lambda file: file)
    monkeypatch.setattr("kinertia.cli.studies.measured_trial", lambda file, progress: (f"trial of {file}", "its name"))
    options = ["--trial", "a.toml"] if measured else []
    arguments = ["--variants", "--repeats", 2, "--seed", 9, *options, "-o", tmp_path / "out"]
    outcome = run("study", "table1", *arguments)
    assert outcome.status == 0, outcome.err
    assert asked == {"trial": "trial of a.toml" if measured else None, "repeats": 2, "seed": 9}
    assert "published" in outcome.out
    assert (tmp_path / "out" / "variants.md").is_file()
    assert not (tmp_path / "out" / "table1.json").exists()
