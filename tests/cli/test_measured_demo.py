"""The measured walk that comes with the package, through every stage: no other files are needed.

Its two-level estimate is in `tests/estimation/test_estimate.py`, by the fixture `short_fit`.
"""

import hashlib
import json
import re

import cut_walk
import numpy as np
import pandas as pd
import pytest

from command_line import fitted, run
from kinertia.checks.verdict import stands_against, verdicts
from kinertia.estimation.from_files import prepare_subject
from kinertia.estimation.simultaneous.skin import OTHER_EXPECTED_SD_M
from kinertia.io.marker_set_file import choose_marker_set
from kinertia.io.recording import read_recording
from kinertia.io.sto import read_sto
from kinertia.trial.plate_assignment import build_trial
from report_page import Elements, figures_of

WINDOW_S = (2.76, 3.58)
"""Where every foot on the ground stands on a plate."""
GRAVITY = 9.80665
RESULTS = {
    *("report.html", "fit.json", "bsp.csv", "model.osim", "kinematics.mot", "residuals.sto"),
    *("inverse_dynamics.sto", "inverse_dynamics_literature.sto", "inverse_dynamics_sd.sto"),
    "kinematics_sd.sto",
    *("ground_reactions.mot", "external_loads.xml", "fit.npz"),
    *("cycles.csv", "cycles_literature.csv", "spatiotemporal.csv"),
}
LAB = {"static.c3d", "walk.c3d", "subject.toml", "README.txt", "LICENSE.txt"}


@pytest.fixture(scope="module")
def static(measured_walk):
    return read_recording(measured_walk / "static.c3d")


@pytest.fixture(scope="module")
def walk(measured_walk):
    return read_recording(measured_walk / "walk.c3d")


@pytest.fixture(scope="module")
def prepared(measured_walk):
    return prepare_subject(measured_walk / "subject.toml")


def words(text):
    return " ".join(text.split())


def test_files_are_small_and_name_source_and_licence(measured_walk):
    assert {path.name for path in measured_walk.iterdir()} == LAB
    assert sum(path.stat().st_size for path in measured_walk.iterdir()) < 3_000_000
    readme = (measured_walk / "README.txt").read_text()
    for needed in (
        "github.com/mitkof6/opensim_automated_pipeline",
        "Copyright 2021 Dimitar Stanev",
        "Version 2.0",
        "cut",
    ):
        assert needed in readme
    assert "Apache License" in (measured_walk / "LICENSE.txt").read_text()


@pytest.mark.parametrize("kind", ["static", "walk"])
def test_nothing_clinical_is_left(measured_walk, kind):
    data = (measured_walk / f"{kind}.c3d").read_bytes().lower()
    for word in (b"diagnos", b"dipleg", b"gmfcs", b"patient", b"subjects", b"spast", b"c_force"):
        assert word not in data


@pytest.mark.parametrize("one", cut_walk.CUTS, ids=lambda one: one.target)
def test_what_is_left_is_as_it_was(measured_walk, measured_folder, tmp_path, one):
    whole = read_recording(measured_folder / "pig_c3d" / one.source)
    part = read_recording(measured_walk / one.target)
    first = np.searchsorted(whole.markers.time, part.markers.time[0] - 1e-6)
    frames = slice(first, first + len(part.markers.time))
    assert part.markers.labels == cut_walk.MARKERS
    np.testing.assert_allclose(part.markers.time, whole.markers.time[frames], atol=1e-12)
    expected = whole.markers.select(cut_walk.MARKERS).positions[frames]
    np.testing.assert_array_equal(part.markers.positions, expected)
    samples = slice(10 * frames.start, 10 * frames.stop)
    np.testing.assert_allclose(part.plates.time, whole.plates.time[samples], atol=1e-12)
    for name in ("force", "moment"):
        np.testing.assert_array_equal(getattr(part.plates, name), getattr(whole.plates, name)[samples])
    np.testing.assert_array_equal(part.plates.corners, whole.plates.corners)
    assert (part.mass_kg, part.height_m, part.measurements) == (whole.mass_kg, whole.height_m, whole.measurements)
    cut_walk.write_cut(one, measured_folder / "pig_c3d" / one.source, tmp_path / "again.c3d")
    assert (tmp_path / "again.c3d").read_bytes() == (measured_walk / one.target).read_bytes()


def test_a_cut_beyond_the_recording_is_refused(measured_walk, tmp_path):
    beyond = cut_walk.Cut("", "", 100, 200)
    with pytest.raises(ValueError, match="does not have all the frames from 100 to 200"):
        cut_walk.write_cut(beyond, measured_walk / "walk.c3d", tmp_path / "part.c3d")


def test_reading_static_trial(static):
    assert (static.mass_kg, static.height_m) == (41.5, pytest.approx(1.61))
    assert static.measurements["LKneeWidth"] == pytest.approx(0.095)
    assert static.markers.positions.shape == (20, 35, 3)
    assert np.isfinite(static.markers.positions).all()
    mean = static.plates.force[:, :, 1].sum(axis=1).mean() / GRAVITY
    assert mean == pytest.approx(41.5, rel=0.05)
    assert choose_marker_set(static.markers.labels).name == "Plug-in Gait"


def test_reading_walk_with_plates(walk):
    assert (walk.length_unit, walk.vertical) == ("mm", "+Z")
    assert walk.markers.rate_hz == pytest.approx(100.0)
    assert (walk.markers.time[0], walk.markers.time[-1]) == pytest.approx((1.52, 5.15))
    assert walk.plates.names == ("plate 1", "plate 2")
    assert len(walk.plates.time) == 10 * len(walk.markers.time)
    top = walk.plates.force[:, :, 1].max(axis=0)
    assert ((top > 1.0 * 41.5 * GRAVITY) & (top < 1.5 * 41.5 * GRAVITY)).all()


def test_plates_by_foot_and_the_measured_window(walk):
    """The left foot steps on plate 1, the right one on plate 2; together they carry the person."""
    trial = build_trial(walk, {side: [f"{side.upper()}{end}" for end in ("HEE", "TOE", "ANK")] for side in "rl"})
    assert len(trial.windows()) == 1
    assert trial.windows()[0] == pytest.approx(WINDOW_S, abs=0.025)
    loads = trial.loads
    for foot, plate in enumerate((1, 0)):
        loaded = walk.plates.force[:, plate, 1] > 100
        heavy = loads.force[:, foot, 1] > 100
        assert (loads.carrier[heavy, foot] == plate).all()
        assert heavy.sum() == pytest.approx(loaded.sum(), rel=0.02)


def test_calibration_and_inverse_kinematics(prepared):
    """Markers are met within some millimetres by joints that bend as joints do, and nothing sits upside down."""
    (kinematics,) = prepared.kinematics
    assert kinematics.window_s == pytest.approx(WINDOW_S, abs=0.025)
    assert kinematics.ik.marker_rms_m < 0.006
    names = list(prepared.skeleton.coordinates)
    for side in "rl":
        knee = np.degrees(kinematics.ik.q[:, names.index(f"knee_angle_{side}")])
        ankle = np.degrees(kinematics.ik.q[:, names.index(f"ankle_angle_{side}")])
        assert 30 < np.ptp(knee) < 80
        assert np.abs(ankle).max() < 45
    assert prepared.literature.total_mass_kg == pytest.approx(41.5)


def test_simultaneous_fit(measured_demo):
    fit = measured_demo.fit
    (trial,) = fit.trials
    assert fit.converged
    assert fit.estimate.physically_consistent().all()
    assert fit.estimate.total_mass_kg == pytest.approx(41.5, rel=0.02)
    assert (fit.posterior.sd <= fit.posterior.prior_sd * (1 + 1e-9)).all()
    force, moment = np.sqrt(np.square(trial.residuals["estimate"]).reshape(-1, 2, 3).sum(axis=2).mean(axis=0))
    before, _ = np.sqrt(np.square(trial.residuals["literature"]).reshape(-1, 2, 3).sum(axis=2).mean(axis=0))
    assert force < 5.0 < before
    assert moment < 3.0
    rms = {stage: np.sqrt(np.nanmean(np.square(errors))) for stage, errors in trial.marker_errors_m.items()}
    # bones leave the markers by what skin is thought to have moved
    assert rms["final"] < np.hypot(rms["ik"], np.sqrt(3.0) * OTHER_EXPECTED_SD_M)
    assert any("plate 1" in warning and "gain" in warning for warning in fit.warnings)


def test_ankles_push_off(measured_demo):
    """Plantarflexion moments late in stance are the largest of the ankle: about 1 N m per kg of the person."""
    moments = measured_demo.fit.trials[0].moments["estimate"]
    assert np.isfinite(moments.to_numpy()).all()
    for side in "rl":
        ankle = moments[f"ankle_angle_{side}"] / 41.5
        assert 0.5 < -ankle.min() < 2.0
        assert ankle.max() < 0.5


def test_results_are_those_of_a_fit(measured_demo):
    folder = measured_demo.folder
    assert {path.name for path in folder.glob("[!.]*")} == {*RESULTS, "lab"}
    assert {path.name for path in (folder / "lab").glob("[!.]*")} == LAB
    summary = json.loads((folder / "fit.json").read_text())
    assert (summary["method"], summary["subject"]["name"]) == ("simultaneous", "Plug-in Gait, subject A")
    (trial,) = summary["trials"]
    assert trial["window_s"] == pytest.approx(WINDOW_S, abs=0.025)
    bsp = pd.read_csv(folder / "bsp.csv")
    assert len(bsp) == 120
    np.testing.assert_allclose(bsp["estimate"], measured_demo.fit.bsp["estimate"], rtol=1e-9)
    motion = read_sto(folder / "kinematics.mot")
    assert len(motion) == trial["n_dynamic_frames"]


@pytest.mark.slow
def test_fit_repeats_the_demo(measured_demo, tmp_path):
    again = fitted(tmp_path / "out", measured_demo.folder / "lab" / "subject.toml")
    assert again.outcome.status == measured_demo.outcome.status
    # these say when and how fast it was
    for name in RESULTS - {"report.html", "fit.json", "fit.npz"}:
        assert (again.folder / name).read_bytes() == (measured_demo.folder / name).read_bytes(), name
    report, printed = (words(outcome.out) for outcome in (again.outcome, measured_demo.outcome))
    assert report[: report.index(" (--verbose")] in printed


def test_report_has_the_fit_and_says_where_it_is_from(measured_demo):
    page = (measured_demo.folder / "report.html").read_text()
    shown = Elements(page).text
    assert "Plug-in Gait, subject A" in shown
    assert f"kinertia demo --measured -o {measured_demo.folder}" in shown
    for name in ("static.c3d", "walk.c3d"):
        assert hashlib.sha256((measured_demo.folder / "lab" / name).read_bytes()).hexdigest() in shown
    assert len(figures_of(page)) >= 5


def test_terminal_says_what_it_is_and_judges_as_fit_does(measured_demo):
    outcome = measured_demo.outcome
    printed = words(outcome.out)
    for needed in ("nobody knows the truth", "opensim_automated_pipeline", "Apache License 2.0", "README.txt"):
        assert needed in printed
    assert "2.760 to 3.580 s used, 83 of 364 frames" in printed
    assert re.search(r"torso +literature +16\.5", outcome.out)
    for warning in measured_demo.fit.warnings:
        assert words(warning) in printed
    assert outcome.status == int(stands_against(verdicts(measured_demo.fit)))
    for stage in ("reading", "calibration", "inverse kinematics", "estimate"):
        assert stage in outcome.err


def test_check_of_the_walk(measured_walk):
    outcome = run("check", measured_walk / "subject.toml")
    assert outcome.status == 0, outcome.err
    printed = words(outcome.out)
    for needed in ("2 plates at 1000 Hz", "33 of its 33 labels", "all contact measured 2.760 to 3.580 s"):
        assert needed in printed
    assert re.search(r"plate 1 +left", outcome.out)
    assert re.search(r"plate 2 +right", outcome.out)


def test_measured_demo_refuses_a_folder_with_other_files(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    outcome = run("demo", "--measured", "-o", tmp_path)
    assert outcome.status == 2
    assert "--force" in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
