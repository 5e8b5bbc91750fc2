"""What a worker says of a person who cannot be fitted: nothing is raised, and what may end otherwise is not kept."""

import shutil
from dataclasses import replace
from unittest import mock

import pandas as pd
import pytest

from kinertia.cohort.job import Job
from kinertia.cohort.person import fit_person
from kinertia.cohort.record import inputs_of, prepare_folder
from kinertia.errors import internal_error
from kinertia.io.subject.reader import read_subject


@pytest.fixture
def job(c3d_lab, tmp_path):
    """A person whose gait trial is the static trial, which no fit can use."""
    shutil.copytree(c3d_lab, tmp_path / "A")
    subject = tmp_path / "A" / "subject.toml"
    text = subject.read_text(encoding="utf-8").replace('markers = "walk.c3d"', 'markers = "static.c3d"')
    subject.write_text(text, encoding="utf-8")
    prepare_folder(tmp_path / "out")
    return Job("A", subject, tmp_path / "out", inputs_of(read_subject(subject)), 1, 60.0)


def test_an_error_in_the_files_is_their_record(job):
    record = fit_person(job)
    assert (record.status, record.inputs, record.fitted) == (2, job.inputs, False)
    assert record.verdict == ""
    found = pd.read_parquet(job.cohort / "failed" / "A.parquet")
    assert set(found.person) == {"A"}
    assert set(found.severity) >= {"ERROR"}
    assert not (job.cohort / "people" / "A").exists()


def test_an_error_in_files_that_changed_meanwhile_is_not_kept(job):
    assert fit_person(replace(job, inputs="of other files")).inputs == ""
    job.subject.unlink()
    gone = fit_person(job)
    assert (gone.status, gone.inputs) == (2, "")
    assert "F101" in gone.sentence


def test_a_worker_of_another_version_fits_nobody(job):
    record = fit_person(replace(job, kinertia="0.0.1"))
    assert (record.status, record.inputs) == (70, "")
    assert "install the same on both" in record.sentence


def test_a_failure_of_kinertia_leaves_a_log(job):
    with mock.patch("kinertia.cohort.person.fit_subject", side_effect=ZeroDivisionError("0 / 0")):
        record = fit_person(job)
    assert (record.status, record.inputs) == (70, job.inputs)
    log = job.cohort / "failed" / "A.log"
    assert record.sentence == internal_error(ZeroDivisionError("0 / 0"), log)
    assert "ZeroDivisionError: 0 / 0" in log.read_text(encoding="utf-8")


def test_a_full_disk_is_told_and_tried_again(job):
    with mock.patch("kinertia.cohort.person.fit_subject", side_effect=OSError(28, "No space left", "out/x")):
        record = fit_person(job)
    assert (record.status, record.inputs) == (2, "")
    assert record.sentence.startswith("out/x: No space left; ")
