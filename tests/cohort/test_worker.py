"""What a worker says of a person who cannot be fitted: nothing is raised, and what may end otherwise is not kept."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from unittest import mock

import pandas as pd
import pytest

from kinertia.cohort.job import Job
from kinertia.cohort.record import inputs_of, prepare_folder
from kinertia.cohort.worker import fit_person, no_end, time_limit, was_ended
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
    with mock.patch("kinertia.cohort.worker.fit_subject", side_effect=ZeroDivisionError("0 / 0")):
        record = fit_person(job)
    assert (record.status, record.inputs) == (70, job.inputs)
    log = job.cohort / "failed" / "A.log"
    assert record.sentence == internal_error(ZeroDivisionError("0 / 0"), log)
    assert "ZeroDivisionError: 0 / 0" in log.read_text(encoding="utf-8")


def test_a_full_disk_is_told_and_tried_again(job):
    with mock.patch("kinertia.cohort.worker.fit_subject", side_effect=OSError(28, "No space left", "out/x")):
        record = fit_person(job)
    assert (record.status, record.inputs) == (2, "")
    assert record.sentence.startswith("out/x: No space left; ")


HANGS = """
    import re, sys
    from pathlib import Path
    from kinertia.cohort.worker import time_limit
    with time_limit(0.2, Path(sys.argv[1]), "this"):
        re.match("(a+)+b", "a" * 60)
"""


def test_what_hangs_is_ended_and_known_in_this_run_only(tmp_path):
    log = tmp_path / "Ben.log"
    code = "\n".join(line.strip() if "re.match" not in line else "    " + line.strip() for line in HANGS.splitlines())
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code, log], env=path, timeout=60)
    assert done.returncode == 1
    assert was_ended(log, "this")
    assert not was_ended(log, "the next")
    assert str(log) in no_end(900.0, log)


def test_what_ends_leaves_nothing(tmp_path):
    log = tmp_path / "Anna.log"
    with time_limit(60.0, log, "this"):
        assert not was_ended(log, "this")
    assert not log.exists()
    assert not was_ended(log, "this")
