import hashlib
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from command_line import fitted, run
from kinertia.cli import demo as demo_module
from kinertia.cli.demo import _two_level_verdict
from kinertia.estimation.simultaneous.markers.skin import OTHER_EXPECTED_SD_M
from kinertia.findings.finding import Severity
from kinertia.io import samples
from kinertia.io.subject.person_recordings import read_inputs
from kinertia.io.subject.reader import read_subject
from kinertia.io.text.sto import read_sto
from kinertia.motion.dynamics import inverse_dynamics
from kinertia.report.pages.page import render
from kinertia.synthetic.walk import unlike_literature, walking_subject
from kinertia.workflow.from_files import prepare_subject
from kinertia.workflow.person import Person
from kinertia.workflow.prepare import prepare
from report_page import Elements, figures_of, numbers


def check_outcome(outcome, folder):
    assert outcome.status == 0, outcome.err
    for words in ("truth", "95 % interval", "kinertia init", "kinertia fit"):
        assert words in outcome.out
    for stage in ("measuring", "reading", "calibration", "inverse kinematics"):
        assert stage in outcome.err
    # with the stage of compiling, which a first run adds
    assert len(outcome.out.splitlines()) + len({"compiling, once", *outcome.err.splitlines()}) <= 30
    names = {"static.trc", "walk.trc", "walk_grf.mot", "subject.toml"}
    assert {path.name for path in (folder / "lab").glob("[!.]*")} == names
    table = pd.read_csv(folder / "bsp_truth.csv")
    assert list(table.columns) == ["segment", "parameter", "unit", "truth", "literature", "estimate", "sd"]
    assert len(table) == 120
    mass = table[table["parameter"] == "mass"]
    assert mass["truth"].sum() == pytest.approx(72.6)
    assert np.abs(mass["truth"] / mass["literature"] - 1).max() > 0.03
    assert json.loads((folder / "fit.json").read_text())["trials"][0]["n_dynamic_frames"] > 90
    results = {path.name for path in folder.glob("[!.]*")}
    assert {"report.html", "bsp.csv", "kinematics.mot", "residuals.sto"} <= results
    off = {name: np.sqrt(np.mean((mass[name] - mass["truth"]) ** 2)) for name in ("literature", "estimate")}
    assert off["estimate"] < off["literature"]


def test_demo_without_instrument_errors(demo_command):
    _, folder, outcome = demo_command
    check_outcome(outcome, folder)
    assert "nothing but noise" in outcome.out


@pytest.mark.slow
@pytest.mark.parametrize("width", ["80", "100"])
def test_demo_from_end_to_end(tmp_path, width, monkeypatch):
    """What the laboratory did wrong is found, and most joint moments are within their intervals."""
    monkeypatch.setenv("COLUMNS", width)
    folder = tmp_path / "out"
    outcome = run("demo", "-o", folder)
    check_outcome(outcome, folder)
    assert sum(-(-len(line) // int(width)) or 1 for line in outcome.out.splitlines()) <= 30
    result = json.loads((folder / "fit.json").read_text())
    found = {
        finding["code"]: finding["evidence"] for finding in result["findings"] if finding["severity"] == "CORRECTED"
    }
    assert found["P223"]["gain_error"]["value"] == pytest.approx(demo_module.LABORATORY.gain, abs=0.012)
    assert found["T214"]["delay_s"]["value"] == pytest.approx(demo_module.LABORATORY.delay_s, abs=0.0035)
    assert result["verdict"] == "use"


@pytest.mark.slow
def test_demo_of_two_level(tmp_path):
    folder = tmp_path / "out"
    outcome = run("demo", "--method", "two-level", "-o", folder)
    assert outcome.status == 0, outcome.err
    assert "95 % interval" not in outcome.out
    assert "Two-level corrects no instruments" in outcome.out
    residuals = json.loads((folder / "fit.json").read_text())["trials"][0]["residual_force_rms_N"]
    assert residuals["estimate"] < residuals["corrected"] < residuals["literature"]


def test_a_measured_walk_has_one_method(tmp_path):
    outcome = run("demo", "--measured", "--method", "two-level", "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "--measured" in outcome.err


def test_same_seed_same_files(tmp_path, demo_run, monkeypatch):
    measured = {}

    def stop(wanted, progress):
        folder = wanted.trials[0].markers.parent
        measured.setdefault(seed, (folder / "walk.trc").read_text())
        raise KeyboardInterrupt

    monkeypatch.setattr(demo_module, "fit_subject", stop)
    for seed in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            demo_module.run_demo(tmp_path / "out", seed)
    assert measured[1] == (demo_run[1] / "lab" / "walk.trc").read_text() != measured[2]


def test_files_hold_nothing_of_the_truth(demo_run):
    """Whoever reads the laboratory's files starts from the literature for the skeleton they give."""
    result, _ = demo_run
    wanted = read_subject(result.subject_file)
    static, inputs, marker_set = read_inputs(wanted)
    ready = prepare(Person(wanted.subject, inputs, static, marker_set=marker_set), wanted.settings)
    np.testing.assert_array_equal(ready.literature.table(), result.fit.literature.table())
    off = np.abs(ready.literature.com_m - result.truth.com_m)
    assert np.median(off) > 0.003


def test_errors_against_the_truth():
    subject = walking_subject()
    truth = unlike_literature(subject, np.random.default_rng(0)).bsp
    demo = demo_module.Demo(fit=None, walk=SimpleNamespace(bsp=truth), noise=None, subject_file=None)
    assert demo.rms_errors(truth) == (0.0, 0.0, 0.0)
    mass, com, inertia = demo.rms_errors(subject.literature)
    assert mass == pytest.approx(np.sqrt(np.mean((subject.literature.mass_kg - truth.mass_kg) ** 2)))
    assert com == pytest.approx(0.01 * np.sqrt(3), rel=0.4)
    assert 0.0 < inertia < 0.1


def test_verdict_follows_the_numbers():
    assert "every class" in _two_level_verdict((1.0, 1.0, 1.0), (2.0, 2.0, 2.0))
    assert "2 of 3 classes" in _two_level_verdict((1.0, 1.0, 1.0), (2.0, 0.5, 2.0))
    assert "luck" in _two_level_verdict((1.0, 1.0, 1.0), (0.5, 0.5, 0.5))


def test_demo_refuses_a_folder_that_is_a_file(tmp_path):
    (tmp_path / "out").write_text("")
    outcome = run("demo", "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "is a file" in outcome.err


def test_joint_moments_against_the_truth(demo_run):
    """The estimate is better at hip and back; with its motion and forces replaced by the truth it is exact."""
    result, _ = demo_run
    errors = result.moment_errors
    for joint in ("hip flexion", "lumbar extension"):
        usual, estimate = errors[joint]
        assert estimate < usual < 15.0
    fit, walk = result.fit, result.walk
    at = np.searchsorted(walk.time, fit.trials[0].time - 1e-9)
    true = inverse_dynamics(walk.skeleton, walk.bsp, walk.motion.cut(at), walk.foot_loads[at])
    assert walk.skeleton.coordinates == fit.skeleton.coordinates
    exact = replace(fit.trials[0], joint_loads={"literature": true, "estimate": true})
    again = replace(result, fit=replace(fit, trials=(exact,)))
    assert set(again.moment_errors.values()) == {(0.0, 0.0)}


def test_intervals_of_moments_against_the_truth(demo_run):
    """A hundredth of the width hardly holds the truth."""
    result, _ = demo_run
    intervals = result.moment_intervals
    assert set(intervals) == set(result.moment_errors)
    assert all(0.85 <= inside <= 1.0 for _, inside in intervals.values())
    (trial,) = result.fit.trials
    narrow = replace(trial.deviations, moments=trial.deviations.moments / 100.0)
    again = replace(result, fit=replace(result.fit, trials=(replace(trial, deviations=narrow),)))
    for joint, (half, inside) in again.moment_intervals.items():
        assert half == pytest.approx(intervals[joint][0] / 100.0)
        assert inside < 0.25


def test_the_report_shows_the_truth(demo_run):
    result, folder = demo_run
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Against the truth" in page
    figures = figures_of(page)
    table = result.table.set_index(["segment", "parameter"])
    forest = figures["changes"]
    (truth, *_) = [trace for trace in forest["data"] if trace["name"] == "truth"]
    expected = (table["truth"] - table["literature"]).xs("mass", level="parameter")[list(result.truth.segments)]
    np.testing.assert_allclose(numbers(truth["x"]), expected, atol=1e-5)
    drawn = [trace for trace in figures["trial1-moments"]["data"] if trace.get("name") == "truth"]
    assert len(drawn) == 21
    assert "Against the truth" not in render(result.fit)


MASS_KG, HEIGHT_M = 72.6, 1.803


WINDOW_S = (1.1, 2.17)
"""Where every foot of the synthetic walk that is on the ground stands on a plate."""


GRAVITY = 9.80665


RESULTS = {
    *("report.html", "fit.json", "bsp.csv", "model.osim", "kinematics.mot", "residuals.sto"),
    *("inverse_dynamics.sto", "inverse_dynamics_literature.sto", "inverse_dynamics_sd.sto"),
    "kinematics_sd.sto",
    *(f"joint_{kind}{sd}.sto" for kind in ("moments", "forces") for sd in ("", "_sd")),
    *("ground_reactions.mot", "external_loads.xml", "fit.npz"),
    *("cycles.csv", "cycles_literature.csv", "contact_phases.csv", "moment_peaks.csv", "spatiotemporal.csv"),
}


LAB = {*samples.SHA256, "subject.toml"}


def words(text):
    return " ".join(text.split())


def test_calibration_and_inverse_kinematics(c3d_lab):
    """Markers are met within some millimetres by joints that bend as joints do, and nothing sits upside down."""
    prepared = prepare_subject(c3d_lab / "subject.toml")
    (kinematics,) = prepared.kinematics
    assert kinematics.window_s == pytest.approx(WINDOW_S, abs=0.025)
    assert kinematics.ik.marker_rms_m < 0.006
    names = list(prepared.skeleton.coordinates)
    for side in "rl":
        knee = np.degrees(kinematics.ik.q[:, names.index(f"knee_angle_{side}")])
        ankle = np.degrees(kinematics.ik.q[:, names.index(f"ankle_angle_{side}")])
        assert 30 < np.ptp(knee) < 80
        assert np.abs(ankle).max() < 45
    assert prepared.literature.total_mass_kg == pytest.approx(MASS_KG)


def test_simultaneous_fit(measured_demo):
    fit = measured_demo.fit
    (trial,) = fit.trials
    assert fit.converged
    assert fit.estimate.physically_consistent().all()
    assert fit.estimate.total_mass_kg == pytest.approx(MASS_KG, rel=0.02)
    assert (fit.posterior.sd <= fit.posterior.prior_sd * (1 + 1e-9)).all()
    force, moment = np.sqrt(np.square(trial.residuals["estimate"]).reshape(-1, 2, 3).sum(axis=2).mean(axis=0))
    before, _ = np.sqrt(np.square(trial.residuals["literature"]).reshape(-1, 2, 3).sum(axis=2).mean(axis=0))
    assert force < 5.0 < before
    assert moment < 3.0
    rms = {stage: np.sqrt(np.nanmean(np.square(errors))) for stage, errors in trial.marker_errors_m.items()}
    # bones leave the markers by what skin is thought to have moved
    assert rms["final"] < np.hypot(rms["ik"], np.sqrt(3.0) * OTHER_EXPECTED_SD_M)


@pytest.mark.measured
def test_ankles_push_off(measured_demo, file_of):
    """Plantarflexion moments late in stance are the largest of the ankle: about 1 N m per kg of the person.

    A synthetic walk shares the load out between heel and toes more roughly than feet do.
    """
    file_of("gait2354/subject01_walk1.trc")
    moments = measured_demo.fit.trials[0].moments["estimate"]
    assert np.isfinite(moments.to_numpy()).all()
    for side in "rl":
        ankle = moments[f"ankle_angle_{side}"] / MASS_KG
        assert 0.5 < -ankle.min() < 2.0
        assert ankle.max() < 0.5


def test_results_are_those_of_a_fit(measured_demo):
    folder = measured_demo.folder
    assert {path.name for path in folder.glob("[!.]*")} == {*RESULTS, "lab"}
    assert {path.name for path in (folder / "lab").glob("[!.]*")} == LAB
    summary = json.loads((folder / "fit.json").read_text())
    assert (summary["method"], summary["subject"]["name"]) == ("simultaneous", "gait2354")
    (trial,) = summary["trials"]
    assert trial["window_s"][1] - trial["window_s"][0] > 0.8
    bsp = pd.read_csv(folder / "bsp.csv")
    assert len(bsp) == 120
    np.testing.assert_allclose(bsp["estimate"], measured_demo.fit.bsp["estimate"], rtol=1e-9)
    motion = read_sto(folder / "kinematics.mot")
    measured = measured_demo.fit.trials[0].time
    assert len(measured) == trial["n_dynamic_frames"]
    assert np.abs(motion.index.to_numpy()[:, None] - measured).min(axis=0).max() < 1e-4


@pytest.mark.slow
def test_fit_repeats_the_demo(measured_demo, tmp_path):
    again = fitted(tmp_path / "out", measured_demo.folder / "lab" / "subject.toml")
    assert again.outcome.status == measured_demo.outcome.status
    # these say when and how fast it was
    for name in RESULTS - {"report.html", "fit.json", "fit.npz"}:
        assert (again.folder / name).read_bytes() == (measured_demo.folder / name).read_bytes(), name
    report, printed = (words(outcome.out) for outcome in (again.outcome, measured_demo.outcome))
    assert report.partition(" results in ")[0] in printed


def test_report_has_the_fit_and_says_where_it_is_from(measured_demo):
    page = (measured_demo.folder / "report.html").read_text()
    shown = Elements(page).text
    assert "gait2354" in shown
    assert f"kinertia demo --measured -o {measured_demo.folder}" in shown
    for name in ("subject01_static.trc", "subject01_walk1.trc", "subject01_walk1_grf.mot"):
        assert hashlib.sha256((measured_demo.folder / "lab" / name).read_bytes()).hexdigest() in shown
    assert len(figures_of(page)) >= 5


def test_terminal_says_what_it_is_and_judges_as_fit_does(measured_demo):
    outcome = measured_demo.outcome
    printed = words(outcome.out)
    for needed in ("whose truth is unknown", "opensim-org/opensim-models", "Apache License 2.0"):
        assert needed in printed
    overview = measured_demo.fit.overview
    assert overview.line in printed
    assert outcome.status == int(overview.severity is Severity.ERROR)
    for stage in ("reading", "calibration", "inverse kinematics", "estimate"):
        assert stage in outcome.err


def test_measured_demo_refuses_a_folder_with_other_files(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    outcome = run("demo", "--measured", "-o", tmp_path)
    assert outcome.status == 2
    assert "--overwrite" in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
