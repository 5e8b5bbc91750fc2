import csv
import json
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest

from kinertia.diagnostics.result.suitability import suitability
from kinertia.errors import FileError
from kinertia.io.output_folder import check_folder
from kinertia.io.text.sto import read_sto
from kinertia.report.exports.contents import summary
from kinertia.report.exports.files import FIT_FILES, TRIAL_FILES
from kinertia.settings import Settings

STAGES = {"literature", "corrected", "estimate"}
RESULTS = {
    "report.html", "fit.json", "fit.npz", "model.osim", "cycles.csv", "cycles_literature.csv", "spatiotemporal.csv",
    "bsp.csv", "kinematics.mot", "inverse_dynamics.sto", "inverse_dynamics_literature.sto", "residuals.sto",
    "ground_reactions.mot", "external_loads.xml", "contact_phases.csv",
}  # fmt: skip
CYCLES = {"cycles.csv", "cycles_literature.csv", "spatiotemporal.csv", "contact_phases.csv"}
FOR_ALL = {"report.html", "fit.json", "fit.npz", "bsp.csv", "model.osim", *CYCLES}
PARAMETERS = ["mass", "com_x", "com_y", "com_z", "ixx", "iyy", "izz", "ixy", "ixz", "iyz"]


@pytest.fixture(scope="module")
def saved(short_fit, tmp_path_factory):
    """One trial of the short fit alone, so that its files stand in the folder itself."""
    fit = replace(short_fit, trials=short_fit.trials[:1])
    return fit, fit.save(tmp_path_factory.mktemp("saved") / "new" / "out")


def test_files(saved):
    _, folder = saved
    assert {path.name for path in folder.glob("[!.]*")} == RESULTS
    assert [path.name for path in folder.parent.iterdir()] == ["out"]


def test_fit_json_keeps_its_contract(saved):
    fit, folder = saved
    fit_summary = json.loads((folder / "fit.json").read_text())
    assert fit_summary["kinertia"] == version("kinertia")
    assert fit_summary["method"] == "two-level"
    assert fit_summary["subject"] == {
        "name": "A",
        "sex": "male",
        "mass_kg": fit.subject.mass_kg,
        "height_m": fit.subject.height_m,
        "age_years": None,
        "population": None,
        "knee_width_mm": None,
        "ankle_width_mm": None,
        "elbow_width_mm": None,
        "ranges_deg": None,
    }
    assert fit_summary["settings"] == Settings(method="two-level").model_dump()
    assert fit_summary["total_mass_kg"] == {
        "measured": fit.subject.mass_kg,
        "literature": fit.literature.mass_kg.sum(),
        "estimate": fit.estimate.mass_kg.sum(),
    }
    assert fit_summary["findings"] == [finding.to_dict() for finding in fit.findings]
    assert (fit_summary["verdict"], fit_summary["rules_run"]) == (fit.overview.verdict, fit.rules)
    assert [rating["output"] for rating in fit_summary["suitability"]] == [
        rating.output for rating in suitability(fit, fit.findings)
    ]
    assert fit_summary["notes"] == list(fit.notes)
    assert fit_summary["converged"] == fit.converged
    (trial,) = fit_summary["trials"]
    assert trial["name"] == "early"
    assert trial["n_frames"] == 270
    assert trial["n_dynamic_frames"] == len(fit.trials[0].time) == 31
    assert trial["window_s"] == pytest.approx([1.2, 1.5])
    assert {"read", "ik", "estimate", "total"} <= set(trial["seconds"])
    assert trial["seconds"]["read"] == 0.25
    assert set(trial["marker_rms_m"]) == {"ik", "final"}
    for quantity in ("force_rms_N", "force_max_N", "moment_rms_Nm", "moment_max_Nm"):
        assert set(trial[f"residual_{quantity}"]) == set(trial[f"full_residual_{quantity}"]) == STAGES
    assert trial["motion_hz"] == trial["cutoff_hz"] == trial["force_cutoff_hz"]
    assert trial["impact_force_rms_N"] == 0.0


def test_bsp_csv_keeps_its_contract(saved):
    fit, folder = saved
    with (folder / "bsp.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["segment", "parameter", "unit", "literature", "estimate"]
    assert [(row["segment"], row["parameter"]) for row in rows] == [
        (segment, parameter) for segment in fit.estimate.segments for parameter in PARAMETERS
    ]
    assert {row["parameter"]: row["unit"] for row in rows} == dict(
        zip(PARAMETERS, ["kg"] + ["m"] * 3 + ["kg m2"] * 6, strict=True)
    )
    for column, bsp in (("literature", fit.literature), ("estimate", fit.estimate)):
        values = np.array([float(row[column]) for row in rows]).reshape(12, 10)
        np.testing.assert_array_equal(values[:, 0], bsp.mass_kg)
        np.testing.assert_array_equal(values[:, 1:4], bsp.com_m)
        np.testing.assert_array_equal(values[:, 4:7], np.diagonal(bsp.inertia_kgm2, axis1=1, axis2=2))
        np.testing.assert_array_equal(values[:, 7], bsp.inertia_kgm2[:, 0, 1])
        np.testing.assert_array_equal(values[:, 8:], bsp.inertia_kgm2[:, [0, 1], [2, 2]])


def table(opensim, path):
    read = opensim.TimeSeriesTable(str(path))
    return np.array(read.getIndependentColumn()), list(read.getColumnLabels()), read.getMatrix().to_numpy()


def test_opensim_reads_the_motion(saved, opensim):
    fit, folder = saved
    time, labels, values = table(opensim, folder / "kinematics.mot")
    trial, skeleton = fit.trials[0], fit.skeleton
    np.testing.assert_allclose(time, trial.time, atol=1e-9)
    assert labels == list(skeleton.coordinates)
    turning = np.asarray(skeleton.rotational)
    assert turning.sum() == 24
    np.testing.assert_allclose(values[:, turning], np.degrees(trial.motion.q[:, turning]), atol=1e-7)
    np.testing.assert_allclose(values[:, ~turning], trial.motion.q[:, ~turning], atol=1e-9)
    storage = opensim.Storage(str(folder / "kinematics.mot"))
    assert storage.isInDegrees()
    assert storage.getSize() == len(time)


@pytest.mark.parametrize(
    ("file", "stage"), [("inverse_dynamics", "estimate"), ("inverse_dynamics_literature", "literature")]
)
def test_opensim_reads_the_joint_loads(saved, opensim, file, stage):
    fit, folder = saved
    time, labels, values = table(opensim, folder / f"{file}.sto")
    np.testing.assert_allclose(time, fit.trials[0].time, atol=1e-9)
    assert labels[:4] == ["pelvis_tx_force", "pelvis_ty_force", "pelvis_tz_force", "pelvis_tilt_moment"]
    assert "hip_flexion_r_moment" in labels
    np.testing.assert_allclose(values, fit.trials[0].moments[stage], rtol=1e-6, atol=1e-9)
    assert not opensim.Storage(str(folder / f"{file}.sto")).isInDegrees()


def test_opensim_reads_residuals_that_give_the_numbers_of_fit_json(saved, opensim):
    _, folder = saved
    _, labels, values = table(opensim, folder / "residuals.sto")
    trial = json.loads((folder / "fit.json").read_text())["trials"][0]
    assert len(labels) == 24
    for stage in (*STAGES, "estimate_full"):
        for kind, unit in (("force", "N"), ("moment", "Nm")):
            size = np.linalg.norm(values[:, [labels.index(f"{stage}_{kind}_{axis}") for axis in "xyz"]], axis=1)
            which, name = ("full_", "estimate") if stage == "estimate_full" else ("", stage)
            rms, largest = (trial[f"{which}residual_{kind}_{value}_{unit}"][name] for value in ("rms", "max"))
            assert rms == pytest.approx(np.sqrt(np.mean(size**2)), rel=1e-5)
            assert largest == pytest.approx(size.max(), rel=1e-5)


HEADER_LINES = 7


def test_headers_say_which_forces_and_hurt_nobody(saved, opensim):
    """pandas with one number of lines to skip for all files; OpenSim by both of its readers."""
    _, folder = saved
    for path in (*folder.glob("*.sto"), *folder.glob("*.mot")):
        header = path.read_text().splitlines()[:HEADER_LINES]
        assert header[-1] == "endheader"
        assert header[-2].endswith("Hz")
        assert ("Ground reactions: " in header[-2]) == (path.name != "kinematics.mot")
        by_pandas = pd.read_csv(path, sep="\t", skiprows=HEADER_LINES, index_col="time", float_precision="round_trip")
        time, labels, values = table(opensim, path)
        assert list(by_pandas.columns) == labels
        np.testing.assert_array_equal(by_pandas.index, time)
        np.testing.assert_array_equal(by_pandas, values)
        pd.testing.assert_frame_equal(by_pandas, read_sto(path), check_exact=True, check_dtype=False)
        storage = opensim.Storage(str(path))
        assert (storage.getName(), storage.getSize()) == (path.stem, len(time))


def test_marker_rms_is_over_visible_markers(short_fit):
    trial = short_fit.trials[0]
    errors = {stage: values.copy() for stage, values in trial.marker_errors_m.items()}
    errors["ik"][:, 0] = np.nan
    errors["ik"][:, 1:] = 0.003
    fit_summary = summary(replace(short_fit, trials=(replace(trial, marker_errors_m=errors),)))
    assert fit_summary["trials"][0]["marker_rms_m"]["ik"] == pytest.approx(0.003)


def test_several_trials_have_a_folder_each(short_fit, tmp_path):
    folder = short_fit.save(tmp_path / "out")
    assert {path.name for path in folder.glob("[!.]*")} == {*FOR_ALL, "early", "late"}
    for name in ("early", "late"):
        assert {path.name for path in (folder / name).glob("[!.]*")} == RESULTS - FOR_ALL
    assert [trial["name"] for trial in json.loads((folder / "fit.json").read_text())["trials"]] == ["early", "late"]


def test_results_replace_older_ones_and_leave_other_files_alone(saved, tmp_path):
    fit, _ = saved
    (tmp_path / "fit.json").write_text('{"kinertia": "old"}')
    (tmp_path / "mine.txt").write_text("kept")
    fit.save(tmp_path, force=True)
    assert json.loads((tmp_path / "fit.json").read_text())["kinertia"] == version("kinertia")
    assert (tmp_path / "mine.txt").read_text() == "kept"
    assert {path.name for path in tmp_path.glob("[!.]*")} == RESULTS | {"mine.txt"}


def test_files_of_others_are_kept_whatever_is_asked(short_fit, tmp_path):
    (tmp_path / "model.osim").write_text("mine")
    with pytest.raises(FileError, match=r"holds files that are not results of Kinertia \(model.osim\).*force=True"):
        short_fit.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["model.osim"]
    assert (tmp_path / "model.osim").read_text() == "mine"
    with pytest.raises(FileError, match=r"model\.osim: is a file of yours"):
        short_fit.save(tmp_path, force=True)
    (tmp_path / "model.osim").rename(tmp_path / "mine.osim")
    short_fit.save(tmp_path, force=True)
    assert "<OpenSimDocument" in (tmp_path / "model.osim").read_text()
    assert (tmp_path / "mine.osim").read_text() == "mine"


def test_a_failure_while_writing_leaves_nothing(saved, tmp_path, monkeypatch):
    fit, _ = saved

    def full_disk(path, *_):
        path.write_text("half a")
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("kinertia.report.exports.files.write_table", full_disk)
    with pytest.raises(FileError, match=r"out: cannot be written \(No space left on device\)"):
        fit.save(tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "taken").write_text("")
    for folder in (tmp_path / "taken", tmp_path / "taken" / "out"):
        with pytest.raises(FileError, match="taken: is a file"):
            check_folder(folder)
    check_folder(tmp_path / "new" / "folder")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_names_of_results_are_known_before(demo_run):
    names = {path.name for path in demo_run[1].iterdir()}
    assert set(FIT_FILES) | set(TRIAL_FILES) <= names


def test_standard_deviations_of_coordinates_are_in_degrees_and_metres(demo_run):
    demo, folder = demo_run
    curves, skeleton = demo.fit.trials[0].joint_curves, demo.fit.skeleton
    written = read_sto(folder / "kinematics_sd.sto")
    sd = curves.deviations.coordinates[curves.known.any(axis=1)]
    for name, factor in (("pelvis_tx", 1.0), ("hip_flexion_r", 180.0 / np.pi)):
        expected = factor * sd[:, skeleton.coordinates.index(name)]
        np.testing.assert_allclose(written[name], expected, rtol=1e-6)
