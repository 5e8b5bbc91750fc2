from dataclasses import astuple

import numpy as np
import pandas as pd
import pytest

from command_line import run
from kinertia.report.table1_variants import CLEAN, HEADINGS, save_variants, variants_frame, variants_rows
from kinertia.studies.table1 import PUBLISHED, Errors
from kinertia.studies.table1_variants import BASE, GROUND, NOISY, Course, VariantResult


@pytest.fixture
def results():
    """Two variants of two draws: twice and four times the published errors; correction is never worse."""

    def courses(factor, conditions):
        values = [Errors(*(factor * np.array(astuple(PUBLISHED[c]))).tolist()) for c in conditions]
        return tuple(Course(each, np.full((4, 3), 0.1), np.array([8.0, 4.0, 3.0, 2.99999])) for each in values)

    draws = tuple(courses(factor, NOISY) for factor in (2.0, 4.0))
    return [VariantResult(variant, courses(1.0, CLEAN), draws) for variant in (BASE, GROUND)]


def test_rows_have_the_published_first(results):
    rows = variants_rows(results)
    assert [len(row) for row in rows] == [len(HEADINGS)] * 3
    published, base, ground = rows
    assert published[2] == "0.93 / 0.38"
    assert base[:2] == [BASE.title, "2"]
    assert base[2:5] == ["2.8 / 1.1", "6.3 / 5.1", "0.59 / 0.54"]
    assert base[-3:] == ["100, 100, 100", published[-2], "3.00"]
    assert ground[0] == GROUND.title


def test_frame_has_every_draw(results):
    frame = variants_frame(results)
    assert len(frame) == 2 * (1 + 2) * 2
    one = frame[(frame["variant"] == GROUND.title) & (frame["draw"] == 1) & (frame["condition"] == "correction_noise")]
    assert one["mass_rms_kg"].item() == 4 * 1.71
    assert one["iterations"].item() == 3
    assert set(frame[frame["condition"].isin(CLEAN)]["draw"]) == {0}


def test_files_are_written(results, without, tmp_path):
    folder = save_variants(results, tmp_path / "out")
    assert sorted(path.name for path in folder.glob("variants*")) == ["variants.csv", "variants.md", "variants.png"]
    assert len((folder / "variants.md").read_text(encoding="utf-8").splitlines()) == 2 + 3
    assert pd.read_csv(folder / "variants.csv").shape == (12, 4 + 10)
    without("matplotlib")
    assert not (save_variants(results, tmp_path / "again") / "variants.png").exists()


def test_command_prints_and_writes(results, tmp_path, monkeypatch):
    asked = {}

    def given(trial, repeats, seed, progress):
        asked.update(repeats=repeats, seed=seed)
        progress(1.0)
        return results

    monkeypatch.setattr("kinertia.cli.study.run_variants", given)
    outcome = run("study", "table1", "--variants", "--repeats", 2, "--seed", 9, "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert asked == {"repeats": 2, "seed": 9}
    assert "published" in outcome.out
    assert (tmp_path / "out" / "variants.md").is_file()
    assert not (tmp_path / "out" / "table1.json").exists()
