"""Tables of everybody, from the rows beside each person's results."""

import hashlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import kinertia
from found import RESIDUAL, UNEXPLAINED, WAIVED, ZERO
from kinertia.cohort import tables as cohort_tables
from kinertia.cohort.record import Place, Record
from kinertia.cohort.tables import write_findings, write_person, write_tables
from kinertia.errors import BlockedError
from kinertia.findings.finding import finding
from kinertia.findings.quantity import Where
from kinertia.io.versions import VERSION

FOUND = (
    replace(RESIDUAL, where=Where(trial="early")),
    *(replace(reported, where=replace(reported.where, trial="late")) for reported in (ZERO, UNEXPLAINED, WAIVED)),
)
PEOPLE = ("Ben", "=cmd", "Anna")
RECORDS = [
    *(Record(name, 0, "", "9f", VERSION, 2, 1.5, "use with care") for name in PEOPLE),
    Record("Clara", 2, "walk  P271 No usable force plates.", "9f", VERSION, 1, 0.1),
]


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cohort(short_fit, tmp_path_factory):
    """A cohort of people with the same results, and one without."""
    folder = tmp_path_factory.mktemp("cohort")
    for name in PEOPLE:
        Place(folder, name).results.mkdir(parents=True)
        write_person(Place(folder, name).results, name, replace(short_fit, findings=FOUND))
    no_forces = [finding("P271", Where(trial="walk"))]
    Place(folder, "Clara").findings.parent.mkdir()
    write_findings(Place(folder, "Clara").findings, "Clara", BlockedError(no_forces, no_forces))
    write_tables(folder, RECORDS, with_csv=True)
    return folder


def hashes(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.*") if path.is_file()}


def test_everybody_who_was_fitted_is_in_the_tables_with_the_fit_s_numbers(cohort, short_fit):
    bsp = pd.read_parquet(cohort / "cohort.parquet")
    names = ["person", "trial", "segment", "parameter", "unit", "literature", "estimate", "sd", "information"]
    assert list(bsp.columns) == names
    assert list(bsp.person.unique()) == list(PEOPLE)
    assert set(bsp.trial) == {"early, late"}
    expected = short_fit.bsp
    for name in PEOPLE:
        rows = bsp[bsp.person == name].reset_index()
        assert (rows.segment + rows.parameter).tolist() == (expected.segment + expected.parameter).tolist()
        np.testing.assert_array_equal(rows[["literature", "estimate"]], expected[["literature", "estimate"]])
    assert bsp.sd.isna().all()  # two-level has none


def test_trials_have_residuals_marker_errors_seconds_and_verdicts(cohort, short_fit):
    trials = pd.read_parquet(cohort / "trials.parquet")
    assert trials.trial.tolist() == ["early", "late"] * len(PEOPLE)
    late, fitted = trials.iloc[1], short_fit.trials[1]
    force = np.linalg.norm(fitted.residuals["estimate"][:, :3], axis=1)
    assert late.residual_force_max_N_estimate == force.max()
    assert late.marker_rms_m_final == pytest.approx(np.sqrt((fitted.marker_errors_m["final"] ** 2).mean()))
    assert late.seconds == pytest.approx(fitted.seconds["total"], abs=1e-4)
    assert trials.verdict[:2].tolist() == ["do not use", "use with care"]
    assert trials.errors[:2].tolist() == ["R301", ""]


def test_findings_are_rows_with_their_headline_and_those_of_people_without_results(cohort):
    rows = pd.read_parquet(cohort / "findings.parquet")
    assert list(rows.columns) == [
        "person", "trial", "plate", "code", "severity", "status", "muted_by", "value", "unit",
    ]  # fmt: skip
    of_person = rows[rows.person == "Anna"].set_index("code")
    assert of_person.index.tolist() == [reported.code for reported in FOUND]
    assert of_person.loc["P213", ["trial", "plate", "severity", "status", "value", "unit"]].tolist() == [
        "late", "plate 1", "WARNING", "open", -23.1, "N",
    ]  # fmt: skip
    assert of_person.muted_by["P214"] == "P213"
    assert of_person.status["P244"] == "waived"
    assert rows[rows.person == "Clara"].code.tolist() == ["P271"]


def test_curves_are_those_of_the_fit(cohort, short_fit):
    cycles = pd.read_parquet(cohort / "cycles.parquet")
    expected = short_fit.cycles()
    rows = cycles[cycles.person == "Anna"].drop(columns=["person", "title"]).reset_index(drop=True)
    assert len(rows) == len(expected) > 0
    assert set(cycles.title[cycles.quantity == "knee_angle_moment"]) == {"Knee moment, flexion +"}
    pd.testing.assert_frame_equal(rows, expected, check_dtype=False)


def test_csv_files_have_the_same_rows_and_no_formula(cohort):
    for name in ("cohort", "trials", "people"):
        csv, table = pd.read_csv(cohort / f"{name}.csv"), pd.read_parquet(cohort / f"{name}.parquet")
        assert csv.shape == table.shape
    assert "\n'=cmd," in (cohort / "people.csv").read_text(encoding="utf-8")
    clara = pd.read_csv(cohort / "people.csv").iloc[-1]
    assert (clara.person, clara.status, clara.sentence) == ("Clara", 2, "walk  P271 No usable force plates.")


def test_the_same_people_give_the_same_bytes_and_csv_files_are_never_of_others(cohort):
    before = hashes(cohort)
    write_tables(cohort, RECORDS, with_csv=False)
    assert hashes(cohort) == before
    write_tables(cohort, RECORDS[2:], with_csv=False)
    assert set(pd.read_csv(cohort / "cohort.csv").person) == {"Anna"}
    write_tables(cohort, RECORDS, with_csv=False)
    assert hashes(cohort) == before
    assert not list(cohort.glob(".kinertia.*"))


def test_pieces_make_one_table(cohort, monkeypatch):
    whole = pd.read_parquet(cohort / "cohort.parquet")
    monkeypatch.setattr(cohort_tables, "_ROWS_AT_ONCE", 150)
    write_tables(cohort, RECORDS, with_csv=True)
    from pyarrow import parquet

    assert parquet.ParquetFile(cohort / "cohort.parquet").num_row_groups == 2
    pd.testing.assert_frame_equal(pd.read_parquet(cohort / "cohort.parquet"), whole)
    pd.testing.assert_frame_equal(pd.read_csv(cohort / "cohort.csv"), whole.replace("=cmd", "'=cmd"), check_dtype=False)


def test_frames_are_read_when_they_are_asked_for(cohort):
    tables = kinertia.read_cohort(cohort)
    bsp = tables["cohort"]
    thigh = bsp[(bsp.parameter == "mass") & (bsp.segment == "thigh_r")].compute()
    assert thigh.person.tolist() == list(PEOPLE)
    assert tables["people"].person.compute().tolist()[-1] == "Clara"
    with pytest.raises(kinertia.FileError, match="folder written by kinertia cohort"):
        kinertia.read_cohort(cohort / "people")
