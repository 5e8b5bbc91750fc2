"""`kinertia demo --measured`, on the sample walk where it is on this machine, elsewhere on a synthetic one."""

import hashlib
import json

import numpy as np
import pandas as pd
import pytest

from command_line import fitted, run
from kinertia.estimation.simultaneous.markers.skin import OTHER_EXPECTED_SD_M
from kinertia.findings.finding import Severity
from kinertia.io import samples
from kinertia.io.text.sto import read_sto
from kinertia.workflow.from_files import prepare_subject
from report_page import Elements, figures_of

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
