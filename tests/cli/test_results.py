"""Commands on finished results: they need no recordings."""

import json
import shutil

import numpy as np
import openpyxl
import pandas as pd
import pytest
from scipy.io import loadmat

from command_line import run
from kinertia.report.exports.saved_fit import FIT_FILE
from report_page import figures_of


@pytest.fixture
def results(demo_run, tmp_path):
    """What is needed of a result folder, alone."""
    folder = tmp_path / "out"
    folder.mkdir()
    for name in (FIT_FILE, "report.html", "fit.json"):
        shutil.copy(demo_run[1] / name, folder)
    return folder


def test_the_report_is_written_again_as_it_was(results):
    before = (results / "report.html").read_text(encoding="utf-8")
    others = sorted(path.name for path in results.iterdir())
    (results / "report.html").unlink()
    outcome = run("report", results)
    assert outcome.status == 0, outcome.err
    assert (results / "report.html").read_text(encoding="utf-8") == before
    assert sorted(path.name for path in results.iterdir()) == others  # nothing else is touched
    assert "<code>kinertia " in before  # command and files stay known


def test_a_letter_is_written_on_request_and_belongs_to_the_results(results):
    outcome = run("report", results, "--letter", "--json")
    assert outcome.status == 0, outcome.err
    told = json.loads(outcome.out)
    assert [told[name] for name in ("report", "letter")] == [
        str(results / f"{page}.html") for page in ("report", "letter")
    ]
    assert 'class="summary letter gait"' in (results / "letter.html").read_text(encoding="utf-8")
    assert run("report", results).status == 0
    assert not (results / "letter.html").exists(), "it would be of another report"


def test_the_report_with_norms(fit, results):
    """Norms as the docs make them: mean and spread of what `cycles.csv` has."""
    grouped = fit.cycles().groupby(["quantity", "percent"])["value"].agg(mean="mean", sd="std").dropna()
    assert len(grouped) > 500
    file = results.parent / "adults.csv"
    grouped.reset_index().to_csv(file, index=False)
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 0, outcome.err
    assert outcome.out.count("note") == 1
    assert "note: The norms state no convention" in outcome.out
    figures = figures_of((results / "report.html").read_text(encoding="utf-8"))
    assert json.dumps(figures).count("norm, mean ") > 20
    file.write_text("quantity,percent,mean,sd\nknee_angle_moment,0,0,1\nkneecap,0,0,1\n")
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 0
    assert "note: norms that this fit has no curve for: kneecap" in outcome.out
    file.write_text("quantity,percent,mean,sd\nkneecap,0,0,1\n")
    outcome = run("report", results, "--norms", file)
    assert outcome.status == 2
    assert "no quantity of it is among the curves of this fit (the first is kneecap)" in outcome.err


def test_export_says_what_the_tables_say(fit, results):
    folder = results.parent / "export"
    for _ in range(2):  # its own results are replaced
        outcome = run("export", results, "--csv", "--json", "--mat", "-o", folder)
        assert outcome.status == 0, outcome.err
    (trial,) = fit.trials
    csv = pd.read_csv(folder / "cycles.csv", float_precision="round_trip")
    pd.testing.assert_frame_equal(csv, fit.cycles(), check_dtype=False, rtol=1e-15, atol=0)
    moments = pd.read_csv(folder / trial.name / "moments.csv", index_col="time_s", float_precision="round_trip")
    np.testing.assert_allclose(moments, trial.moments["estimate"], rtol=1e-15)
    plain = json.loads((folder / "tables.json").read_text())
    np.testing.assert_array_equal(plain["bsp"]["estimate"], fit.bsp.estimate)
    assert None in plain["cycles"]["value"]  # gaps
    np.testing.assert_array_equal(plain["trials"][trial.name]["moments"]["knee_angle_r"], moments.knee_angle_r)
    mat = loadmat(folder / "tables.mat", simplify_cells=True)
    np.testing.assert_array_equal(mat["bsp"]["estimate"], fit.bsp.estimate)
    assert [segment.rstrip() for segment in mat["bsp"]["segment"]] == list(fit.bsp.segment)
    assert mat["trials"]["name"] == trial.name
    angle = np.degrees(trial.coordinates.knee_angle_r)
    np.testing.assert_allclose(mat["trials"]["coordinates"]["knee_angle_r"], angle, rtol=1e-12)


@pytest.mark.slow
def test_a_workbook_holds_the_strides_side_by_side(fit, results):
    folder = results.parent / "excel"
    outcome = run("export", results, "--xlsx", "-o", folder)
    assert outcome.status == 0, outcome.err
    sheets = pd.read_excel(folder / "tables.xlsx", sheet_name=None, header=None)
    expected = ["About", "Spatiotemporal", "Peaks", "Clinical angles", "Joint moments", "Model angles", "Model moments"]
    assert list(sheets)[:7] == expected
    book = pd.read_excel(
        folder / "tables.xlsx", sheet_name="Joint moments", header=[0, 1, 2, 3, 4, 5], index_col=0
    ).sort_index(axis=1)
    cycles = fit.cycles()
    chosen = cycles[cycles.quantity.str.endswith("_joint_moment")]
    assert book.shape == (101, 2 * len(chosen) / 101)
    for key, stride in chosen.groupby(["quantity", "trial", "task", "side", "stride"]):
        kept = book[key]
        assert list(kept) == ["N m/kg", "SD (N m/kg)"]
        np.testing.assert_allclose(kept.to_numpy(float), stride[["value", "sd"]].to_numpy(), rtol=1e-12)
    peaks = pd.read_excel(folder / "tables.xlsx", sheet_name="Peaks")
    widths = openpyxl.load_workbook(folder / "tables.xlsx")["Peaks"].column_dimensions
    assert widths["F"].width > peaks.peak.str.len().max()
    assert not sheets["Clinical angles"].iloc[5].astype(str).str.startswith("SD").any(), "there are none"
    pd.testing.assert_frame_equal(peaks, fit.peaks, check_dtype=False, rtol=1e-12)


def test_export_asks_for_a_form(results):
    outcome = run("export", results, "-o", results.parent / "export")
    assert outcome.status == 2
    assert "--xlsx, --csv, --json, --mat, --c3d or --draws" in " ".join(outcome.err.split())


@pytest.mark.parametrize("command", [["report"], ["export", "--csv", "-o", "tables"]])
def test_a_folder_without_results_is_told(tmp_path, monkeypatch, command):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    outcome = run(command[0], tmp_path / "here", *command[1:])
    assert outcome.status == 2
    assert "no results of kinertia fit here" in " ".join(outcome.err.split())
    assert not list((tmp_path / "here").iterdir())


def test_compare_prints_json_for_scripts(demo_run, two_level_run, tmp_path):
    outcome = run("compare", demo_run[1], two_level_run[1], "-o", tmp_path / "out", "--json")
    assert outcome.status == 0, outcome.err
    content = json.loads(outcome.out)
    ((name, rows),) = content["against_first"].items()
    assert "two-level" in name
    table = pd.read_csv(tmp_path / "out" / "compare.csv")
    assert [row["segment"] for row in rows] == table.segment.tolist()[-len(rows) :]
    assert rows[0]["change"] == pytest.approx(rows[0]["other"] - rows[0]["first"])
    assert {row["sd"] for row in rows} == {None}, "two-level has no error bars"
    told = run("compare", demo_run[1], two_level_run[1], "-o", tmp_path / "out").out
    assert "out: no error bars, differences only" in " ".join(told.split())


def test_export_writes_posterior_draws(results):
    """Each a set of its own; the same with the same seed."""
    folder = results.parent / "draws"
    outcome = run("export", results, "--draws", "2", "--seed", "3", "-o", folder)
    assert outcome.status == 0, outcome.err
    files = ["external_loads.xml", "ground_reactions.mot", "kinematics.mot", "model.osim"]
    for draw in ("draw_001", "draw_002"):
        assert sorted(path.name for path in (folder / draw).iterdir()) == files
    first = {name: (folder / "draw_001" / name).read_bytes() for name in files}
    assert all(content != (folder / "draw_002" / name).read_bytes() for name, content in list(first.items())[1:])
    assert run("export", results, "--draws", "1", "--seed", "3", "-o", folder).status == 0
    assert {name: (folder / "draw_001" / name).read_bytes() for name in files} == first
    assert not (folder / "draw_002").exists()
    outcome = run("export", results, "--draws", "5000", "-o", folder)
    assert outcome.status == 2
    assert "5000 posterior draws are asked for" in " ".join(outcome.err.split())
    assert (folder / "draw_001").exists(), "what was there stays"
