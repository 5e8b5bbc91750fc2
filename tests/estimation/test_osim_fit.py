"""`kinertia fit --model`: the files it leaves, opened by OpenSim, and what it finds on four users' models."""

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from command_line import fitted, run
from kinertia.io.opensim.reader import read_osim
from kinertia.io.opensim.writer import export_osim
from kinertia.io.text.sto import read_sto
from kinertia.io.text.trc import read_trc
from kinertia.motion.kinematics import inside
from recordings import FITTED
from validation import osim_models
from validation.measured_trials import messages_of

CASES = [
    case if case[0] == "synthetic" or case == ("gait2354", False) else pytest.param(*case, marks=pytest.mark.slow)
    for case in [
        ("synthetic", False),
        ("synthetic", True),
        ("gait2354", False),
        ("gait2354", True),
        ("rajagopal", True),
    ]
    if case[0] in FITTED
]


def opensim_markers(opensim, model: Path, motion: Path, labels) -> tuple[np.ndarray, np.ndarray]:
    """Times and (n, m, 3) m markers of a model that OpenSim moves by a motion file."""
    loaded = opensim.Model(str(model))
    state = loaded.initSystem()
    table = read_sto(motion)
    coordinate_set = loaded.getCoordinateSet()
    coordinates = [coordinate_set.get(i) for i in range(coordinate_set.getSize())]
    assert {c.getName() for c in coordinates} == set(table.columns)
    turns = {c.getName() for c in coordinates if c.getMotionType() == opensim.Coordinate.Rotational}
    for coordinate in coordinates:
        coordinate.setLocked(state, False)
    positions = []
    for _, row in table.iterrows():
        for coordinate in coordinates:
            value = row[coordinate.getName()]
            coordinate.setValue(state, float(np.radians(value) if coordinate.getName() in turns else value), False)
        loaded.realizePosition(state)
        markers = loaded.getMarkerSet()
        positions.append([markers.get(label).getLocationInGround(state).to_numpy() for label in labels])
    return table.index.to_numpy(), np.array(positions)


@pytest.mark.parametrize(("name", "calibrate"), CASES)
def test_opensim_sees_the_markers_where_the_fit_says(opensim, file_of, fit_with_model, name, calibrate):
    """Model and motion as written: all coordinates, locked and coupled ones too, and calibrated markers and joints."""
    folder = fit_with_model(name, calibrate)
    trial = json.loads((folder / "fit.json").read_text())["trials"][0]
    measured = read_trc(file_of(FITTED[name]))
    labels = list(used_labels(folder))
    time, modelled = opensim_markers(opensim, folder / "model.osim", folder / "kinematics.mot", labels)
    frames = np.searchsorted(measured.time, time - 1e-6)
    distance = np.linalg.norm(measured.select(labels).positions[frames] - modelled, axis=-1)
    distance = distance[inside(time, trial["windows_s"])]
    assert np.sqrt(np.nanmean(distance**2)) == pytest.approx(trial["marker_rms_m"]["final"], abs=1e-6)


def used_labels(folder: Path):
    """Labels of the markers that the fit used."""
    return json.loads((folder / "fit.json").read_text())["marker_noise"].popitem()[1]["sd_m"]


@pytest.mark.parametrize(("name", "calibrate"), CASES)
def test_the_written_model_carries_the_estimate(opensim, fit_with_model, name, calibrate):
    folder = fit_with_model(name, calibrate)
    estimate = pd.read_csv(folder / "bsp.csv").pivot(index="segment", columns="parameter", values="estimate")
    loaded = opensim.Model(str(folder / "model.osim"))
    loaded.initSystem()
    for segment, row in estimate.iterrows():
        body = loaded.getBodySet().get(segment)
        assert body.getMass() == pytest.approx(row["mass"], rel=1e-12)
        centre, moments = body.getMassCenter(), body.getInertia().getMoments()
        np.testing.assert_allclose([centre.get(i) for i in range(3)], row[["com_x", "com_y", "com_z"]], atol=1e-12)
        np.testing.assert_allclose([moments.get(i) for i in range(3)], row[["ixx", "iyy", "izz"]], rtol=1e-9)


@pytest.mark.parametrize(("name", "calibrate"), CASES)
def test_changes_are_what_was_asked_for(fit_with_model, name, calibrate):
    changes = pd.read_csv(fit_with_model(name, calibrate) / "model_changes.csv")
    mass = {"mass", "mass_center", "inertia"}
    assert set(changes["property"]) == (mass | {"location", "translation"} if calibrate else mass)


def assert_targets(folder: Path) -> None:
    """Residual RMS at most 5 N and 3 N m, markers at most 12 mm, no silent departure of a parameter."""
    summary = json.loads((folder / "fit.json").read_text())
    assert summary["converged"]
    for trial in summary["trials"]:
        assert trial["residual_force_rms_N"]["estimate"] <= 5.0
        assert trial["residual_moment_rms_Nm"]["estimate"] <= 3.0
        assert trial["marker_rms_m"]["final"] <= 0.012
    bsp = pd.read_csv(folder / "bsp.csv").query("prior_sd > 0")
    far = bsp[(bsp["estimate"] - bsp["literature"]).abs() > 3 * bsp["prior_sd"]]
    found = [finding for finding in summary["findings"] if finding["code"] == "R203"]
    named = {(finding["evidence"]["parameter"]["value"], finding["where"]["part"].split()[-1]) for finding in found}
    # both sides of a segment have one finding
    pairs = [(parameter, name, name[:-2]) for parameter, name in zip(far["parameter"], far["segment"], strict=True)]
    count = Counter((parameter, both) for parameter, _, both in pairs)
    expected = {(parameter, both if count[parameter, both] > 1 else name) for parameter, name, both in pairs}
    assert named == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ("synthetic", "gait2354", "rajagopal") if name in FITTED])
def test_residuals_markers_and_parameters(fit_with_model, name):
    assert_targets(fit_with_model(name, True))


@pytest.mark.slow
@pytest.mark.first
def test_walks_and_squats_pooled(measured_folder, tmp_path):
    """Of the squats, the first two."""
    subject = tmp_path / "subject4.toml"
    text = osim_models.subject_file(measured_folder, osim_models.PEOPLE["subject4"], True)
    subject.write_text(f"{text}window_s = [0.0, 5.0]\n")
    folder = fitted(tmp_path / "out", subject).folder
    assert_targets(folder)
    summary = json.loads((folder / "fit.json").read_text())
    assert [trial["name"] for trial in summary["trials"]] == ["walking1", "walking2", "squats1"]
    corrected = [finding for finding in summary["findings"] if finding["code"] == "P277"]
    assert ("ForcePlate2", "left") in [
        (finding["where"]["plate"][:11], finding["evidence"]["foot"]["value"]) for finding in corrected
    ]
    assert (folder / "walking2" / "kinematics.mot").is_file()


@pytest.mark.slow
@pytest.mark.measured
def test_page_of_models(fit_with_model):
    runs = {}
    for calibrate in (False, True):
        folder = fit_with_model("gait2354", calibrate)
        bsp = pd.read_csv(folder / "bsp.csv")
        runs["gait2354", calibrate] = {**json.loads((folder / "fit.json").read_text()), "bsp": bsp}
    page = osim_models.document(runs)
    for (_, calibrate), summary in runs.items():
        (trial,) = summary["trials"]
        title = f"gait2354, {'calibrated' if calibrate else 'as it is'}"
        residual = trial["residual_force_rms_N"]["estimate"], trial["residual_moment_rms_Nm"]["estimate"]
        cells = rf"\| {trial['marker_rms_m']['final'] * 1e3:.1f} \|.*\| {residual[0]:.1f} \|.*\| {residual[1]:.1f} \|"
        assert re.search(rf"\| {title}: subject01_walk1 .*{cells}", page)
        for message in messages_of(summary):
            assert f"- {title}: {message}" in page


@pytest.mark.slow
@pytest.mark.measured
def test_the_built_in_model_is_written_as_a_model_too(opensim, fit_of):
    fit = fit_of("pig_a")
    loaded = opensim.Model(str(fit.folder / "model.osim"))
    state = loaded.initSystem()
    assert loaded.getTotalMass(state) == pytest.approx(fit.summary["total_mass_kg"]["estimate"])
    motion = read_sto(fit.folder / "kinematics.mot")
    names = {loaded.getCoordinateSet().get(i).getName() for i in range(loaded.getCoordinateSet().getSize())}
    assert set(motion.columns) == names


def options(lab: Path, **more: object) -> list[object]:
    given = {"--forces": lab / "walk_grf.mot", "--loads": lab / "walk_grf.xml", "--mass": 72.6}
    given["--model"] = lab / "users.osim"
    given |= {f"--{name}": value for name, value in more.items()}
    return [lab / "walk.trc", *(word for pair in given.items() for word in pair)]


BAD = {
    "no model": ({"model": "nowhere.osim"}, "F101 There is no nowhere.osim"),
    "a model that is none": ({"model": "walk_grf.xml"}, "no Model in it"),
    "a model without markers": ({"model": "bare.osim"}, "bare.osim: O106 "),
    "the study's method": ({"method": "two-level"}, "works on the built-in model only"),
    "a static trial as well": ({"static": "static.trc"}, "F193 osim and static"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(synthetic_lab, tmp_path, case):
    given, message = BAD[case]
    model = read_osim(synthetic_lab / "users.osim")
    export_osim(tmp_path / "bare.osim", replace(model.skeleton, markers=()), model.bsp)
    folders = {"bare.osim": tmp_path}
    files = {key: folders.get(value, synthetic_lab) / value if "." in value else value for key, value in given.items()}
    outcome = run("fit", *options(synthetic_lab, **files), "-o", tmp_path / "out")
    assert outcome.status == 2
    assert message in " ".join(outcome.err.split())
    assert not (tmp_path / "out").exists()


def test_calibrate_goes_with_a_model(synthetic_lab, tmp_path):
    static = synthetic_lab / "static.trc"
    words = [*options(synthetic_lab)[:1], "--static", static, "--sex", "male", "--height", 1.8, "--mass", 72.6]
    outcome = run("fit", *words, "--calibrate", "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "F193 calibrate in [model] and a static trial" in " ".join(outcome.err.split())


@pytest.mark.slow
def test_whole_squats_end_with_a_plausible_body(measured_folder, tmp_path):
    """What thighs weigh less in squats is left out of the cost; that it adds to the cost refused the average."""
    lab = measured_folder / "subject4"
    files = [lab / "squats1.trc", "--forces", lab / "squats1_grf.mot", "--loads", lab / "squats1_external_forces.xml"]
    model = ["--model", lab / "addbiomechanics_scaled.osim", "--calibrate", "--mass", "62.6"]
    folder = fitted(tmp_path / "out", *map(str, [*files, *model])).folder
    summary = json.loads((folder / "fit.json").read_text())
    assert "R203" not in {finding["code"] for finding in summary["findings"]}
