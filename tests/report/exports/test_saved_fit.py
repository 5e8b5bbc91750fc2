"""A result opened again is the same result: nothing is computed anew, nothing is missing."""

import shutil

import numpy as np
import pandas as pd
import pytest

import kinertia
from kinertia.errors import FileError
from kinertia.io.subject.provenance import Provenance
from kinertia.report.exports.contents import content_of
from kinertia.report.exports.files import save_fit
from kinertia.report.exports.saved_fit import FIT_FILE, read_saved
from kinertia.report.pages.page import render


@pytest.fixture(scope="module")
def loaded(demo_run, tmp_path_factory):
    """From `fit.npz` alone, far from the recordings."""
    folder = tmp_path_factory.mktemp("moved")
    shutil.copy(demo_run[1] / FIT_FILE, folder)
    return kinertia.load_fit(folder)


def test_the_same_report_to_the_letter(fit, loaded):
    assert render(loaded) == render(fit)


def test_the_same_files_to_the_byte(fit, loaded, tmp_path):
    for saved, name in ((fit, "first"), (loaded, "second")):
        save_fit(content_of(saved, Provenance("kinertia fit x", {"x": "0"})), tmp_path / name)
    names = {path.relative_to(tmp_path / "first") for path in (tmp_path / "first").rglob("*") if path.is_file()}
    assert len(names) >= 12
    for name in names:
        assert (tmp_path / "second" / name).read_bytes() == (tmp_path / "first" / name).read_bytes(), name


def test_tables_figures_and_findings(fit, loaded):
    pd.testing.assert_frame_equal(loaded.bsp, fit.bsp, check_exact=True)
    pd.testing.assert_frame_equal(loaded.cycles(), fit.cycles(), check_exact=True)
    pd.testing.assert_frame_equal(loaded.covariance, fit.covariance, check_exact=True)
    assert loaded.findings == fit.findings
    assert loaded.overview.line == fit.overview.line
    assert loaded.plot.moments() == fit.plot.moments()
    assert loaded.subject == fit.subject
    assert loaded.settings == fit.settings
    np.testing.assert_array_equal(
        loaded.trials[0].kinematics.spline(fit.trials[0].time, 2),
        fit.trials[0].kinematics.spline(fit.trials[0].time, 2),
    )


@pytest.mark.slow
@pytest.mark.measured
def test_a_fit_with_an_own_model(fit_with_model, tmp_path):
    """Its file comes along: the model with the estimate is written without it."""
    folder = fit_with_model("gait2354", True)
    again = kinertia.load_fit(folder).save(tmp_path / "again")
    for name in ("model.osim", "model_changes.csv", "kinematics.mot", "cycles.csv"):
        assert (again / name).read_bytes() == (folder / name).read_bytes(), name


def test_what_it_is_from_comes_along(demo_run):
    saved = read_saved(demo_run[1])
    assert saved.provenance is not None
    assert saved.versions["kinertia"] == kinertia.__version__


def test_folders_without_results_are_told(tmp_path):
    with pytest.raises(FileError, match="no such folder"):
        kinertia.load_fit(tmp_path / "nowhere")
    with pytest.raises(FileError, match=r"holds no fit\.npz"):
        kinertia.load_fit(tmp_path)


def test_a_file_in_place_of_its_folder_is_told(demo_run):
    with pytest.raises(FileError, match="is a file; give its folder"):
        kinertia.load_fit(demo_run[1] / "report.html")


def test_in_words_a_fit_is_a_line(fit):
    assert repr(fit) == "Fit(synthetic walker, 72.6 kg, simultaneous; walk)"
    assert repr(fit.trials[0]).startswith("TrialFit(walk: ")
    assert len(repr(fit.trials)) < 100
