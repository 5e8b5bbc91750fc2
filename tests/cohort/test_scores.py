"""Gait Profile Scores of a cohort: in its tables and on its page."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.cohort.page import score_parts
from kinertia.cohort.record import Place, Record
from kinertia.cohort.tables import write_person, write_tables
from kinertia.estimation.result.mean_cycles import gait_profile
from kinertia.io.norms_file import Norm
from kinertia.io.versions import VERSION
from kinertia.motion.model_outputs import CLINICAL_ANGLES
from kinertia.report.exports.saved_fit import FIT_FILE, write_fit

parquet = pytest.importorskip("pyarrow.parquet")

NORMS = {
    name: Norm(np.array([0.0, 100.0]), np.full(2, 5.0), np.ones(2), 4, "Kinertia gait27", (7.0, 11.0))
    for name in CLINICAL_ANGLES
}
PEOPLE = ("Anna", "Ben")


@pytest.fixture(scope="module")
def folder(fit, tmp_path_factory):
    """Two people, of whom one has no stride."""
    folder = tmp_path_factory.mktemp("cohort")
    standing = replace(fit, trials=tuple(replace(trial) for trial in fit.trials))
    for trial in standing.trials:
        trial.__dict__["strides"] = ()
    subject = fit.subject.model_copy(update={"age_years": 30.0})
    for name, person in zip(PEOPLE, (replace(fit, subject=subject), standing), strict=True):
        place = Place(folder, name).results
        place.mkdir(parents=True)
        write_person(place, name, person)
        write_fit(person, None, place / FIT_FILE)
    return folder


def tables(folder, norms):
    records = [Record(name, 0, "", "9f", VERSION, 1, 1.5, "use") for name in PEOPLE]
    write_tables(folder, records, False, norms)
    return parquet.read_table(folder / "scores.parquet").to_pandas()


def test_scores_of_everybody_are_those_of_each_fit(fit, folder):
    scores = tables(folder, NORMS)
    anna = scores[scores.person == "Anna"]
    expected = gait_profile(fit, NORMS).table
    np.testing.assert_allclose(anna.degrees, expected.degrees)
    assert anna.variable.tolist() == expected.variable.tolist()
    assert "30 years old, people in the norms 7 to 11" in anna.remarks.iloc[0]
    (part,) = score_parts(folder)
    assert len(part.rows) == 2
    row = next(cells for cells in part.rows if "Anna" in cells[0])
    assert any(cell.startswith(tuple("123456789")) for cell in row[1:4])
    assert row[5].startswith("This person is 30 years old")


def test_without_norms_there_are_no_scores(folder):
    assert not len(tables(folder, {}))
    assert not list(score_parts(folder))


def test_norms_of_another_model_give_a_reason_in_place_of_scores(folder):
    other = {name: replace(norm, convention="OpenSim model") for name, norm in NORMS.items()}
    scores = tables(folder, other)
    assert len(scores) == 2
    assert scores.degrees.isna().all()
    assert "the norms are of OpenSim model" in scores.remarks[0]
