import json
from dataclasses import replace

import numpy as np
import pytest

import kinertia.studies.sensitivity as sensitivity_study
import study_results
from command_line import run
from kinertia.studies.sensitivity import AMPLITUDES, CONDITIONS, SHOWN, STRIDE_S, WITH_SQUATS, run_sensitivity
from one_process import in_one_process


def test_answers():
    sensitivity = study_results.sensitivity()
    assert sensitivity.insensitive("study") == ["torso.com_z"]
    assert sensitivity.insensitive("artefact") == ["torso.com_z", "thigh.mass"]
    assert sensitivity.never() == ["pelvis.iyy"]


def test_conditions_change_one_thing_at_a_time():
    assert {f"{kind} x {a:g}" for kind in ("study", "artefact") for a in AMPLITUDES} < set(CONDITIONS)
    assert CONDITIONS[WITH_SQUATS].others == ("squat",)
    assert not CONDITIONS["artefact x 1"].others
    assert CONDITIONS["strides 8"].walk_s == 8 * 1.25
    assert CONDITIONS["study x 0.25"].faults.amplitude == 0.25


@pytest.fixture
def few_conditions(monkeypatch):
    kept = {key: replace(CONDITIONS[key], walk_s=STRIDE_S) for key in ("study x 0.25", "study x 2")}
    monkeypatch.setattr(sensitivity_study, "CONDITIONS", kept)


@pytest.mark.slow
@pytest.mark.usefixtures("few_conditions")
@in_one_process()
def test_noise_makes_errors_larger():
    sensitivity = run_sensitivity(2)
    small, large = sensitivity.errors["study x 0.25"], sensitivity.errors["study x 2"]
    assert small.shape == (7 * len(SHOWN),)
    assert np.mean(small.reshape(-1, 7)[:, :4]) < np.mean(large.reshape(-1, 7)[:, :4])
    masses = [i for i, name in enumerate(sensitivity.parameters) if name.endswith(".mass")]
    assert len(masses) == 7


def test_command(tmp_path, monkeypatch):
    monkeypatch.setattr("kinertia.cli.studies.run_sensitivity", lambda *arguments: study_results.sensitivity())
    outcome = run("study", "sensitivity", "-o", tmp_path / "out")
    assert outcome.status == 0, outcome.err
    assert "torso.com_z, thigh.mass" in outcome.out
    content = json.loads((tmp_path / "out" / "sensitivity.json").read_text())
    assert content["shown_by_no_condition"] == ["pelvis.iyy"]
    assert (tmp_path / "out" / "sensitivity.png").stat().st_size > 10_000
    page = (tmp_path / "out" / "sensitivity.md").read_text()
    assert "noise (8.2 mm RMS at twice): torso.com_z\n" in page
    assert "not at twice): thigh.mass\n" in page
    assert "1 of 3 parameters (moments of inertia: 1)" in page
    assert "| pelvis.iyy | 0.99 | 0.99 | 1.00 |" in page
    assert (tmp_path / "out" / "sensitivity.csv").read_text().startswith("parameter,study x 0.25")
