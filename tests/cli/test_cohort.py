"""`kinertia cohort`: from a study to one folder per person and one table for all, whatever happens on the way."""

import contextlib
import hashlib
import json
import random
import shutil
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import psutil
import pytest

from cohort_faults import write_study
from command_line import PROGRAM, run
from kinertia.cli.cohort import _LOCK
from kinertia.cohort.cluster import doubts_of_workers
from kinertia.errors import how_to_install
from kinertia.io.working_folder import sole_use
from kinertia.workflow.from_files import fit_subject


@pytest.fixture
def lacking(tmp_path, c3d_lab):
    """A study in which nobody can be fitted: one person without a subject file, one whose file has an error."""
    study = tmp_path / "study"
    shutil.copytree(c3d_lab, study / "Anna")
    (study / "Anna" / "subject.toml").unlink()
    shutil.copytree(c3d_lab, study / "Ben")
    subject = study / "Ben" / "subject.toml"
    subject.write_text(subject.read_text(encoding="utf-8").replace("mass_kg", "mas_kg"), encoding="utf-8")
    return study


def hashes(folder):
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_dry_run_says_who_how_much_and_what_is_missing(lacking, c3d_lab, tmp_path):
    shutil.copytree(c3d_lab, lacking / "Clara")
    shutil.copytree(c3d_lab, lacking / "Dora")
    dora = lacking / "Dora" / "subject.toml"
    dora.write_text(dora.read_text(encoding="utf-8").replace("walk.c3d", "walk.trc"), encoding="utf-8")
    (lacking / "Dora" / "walk.trc").touch()
    outcome = run("cohort", lacking, "-o", tmp_path / "out", "--dry-run")
    assert outcome.status == 1
    printed = " ".join(outcome.out.split())
    assert "no subject file; kinertia init" in printed
    assert "F191" in printed
    assert "Clara to fit 1" in printed
    assert "4 people: 1 to fit, 0 as before, 3 with missing inputs" in printed
    assert "On this computer, in 1 process, each with one thread" in printed
    assert "very roughly 1 min" in printed
    assert not (tmp_path / "out").exists()
    planned = json.loads(run("cohort", lacking, "-o", tmp_path / "out", "--dry-run", "--json").out)["people"]
    assert [(person["person"], person["state"], person["trials"]) for person in planned][2] == ("Clara", "due", 1)
    assert [person["state"] for person in planned] == ["lacking", "lacking", "due", "lacking"]
    assert "no subject file" in planned[0]["why"]
    assert "has no forces; name the force file" in planned[3]["why"]


def test_who_cannot_be_fitted_is_in_the_list_of_people(lacking, tmp_path):
    out = tmp_path / "out"
    outcome = run("cohort", lacking, "-o", out)
    assert outcome.status == 1, outcome.err
    people = pd.read_csv(out / "people.csv")
    assert people.person.tolist() == ["Anna", "Ben"]
    assert people.status.tolist() == [2, 2]
    assert "not fitted: Ben: " in outcome.out
    assert len(pd.read_parquet(out / "cohort.parquet")) == 0
    before = hashes(out)
    again = run("cohort", lacking, "-o", out, "--json")
    assert again.status == 1
    ended = json.loads(again.out)["people"]
    assert [(person["person"], person["status"], person["fitted"]) for person in ended] == [
        ("Anna", 2, False),
        ("Ben", 2, False),
    ]
    assert hashes(out) == before


def test_two_runs_on_one_folder_refuse_each_other(lacking, tmp_path):
    out = tmp_path / "out"
    assert run("cohort", lacking, "-o", out).status == 1
    before = hashes(out)
    with sole_use(out / _LOCK, "the folder"):
        outcome = run("cohort", lacking, "-o", out)
    assert outcome.status == 2
    assert "in use by process" in outcome.err
    assert hashes(out) == before


def test_bad_input_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "people.csv").write_text("file\na.toml\n", encoding="utf-8")
    outcome = run("cohort", tmp_path / "people.csv", "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "F103" in outcome.err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr("kinertia.cohort.cluster.find_spec", lambda name: None if name == "pyarrow" else name)
    outcome = run("cohort", tmp_path, "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "cohorts need pyarrow, which is not installed: " + how_to_install("cohort") in outcome.err


@pytest.fixture
def study(tmp_path):
    """Two people who can be fitted, and one with a window in which nothing was recorded."""
    write_study(tmp_path / "study", ("Anna", "Ben"))
    shutil.copytree(tmp_path / "study" / "Anna", tmp_path / "study" / "Clara")
    path = tmp_path / "study" / "Clara" / "subject.toml"
    path.write_text(
        path.read_text(encoding="utf-8").replace("[[trial]]", "[[trial]]\nwindow_s = [90.0, 91.0]"), encoding="utf-8"
    )
    return tmp_path / "study"


def workers_of(process):
    """Processes that fit people for a command."""
    workers = []
    for child in psutil.Process(process.pid).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            workers += [child] * ("kinertia.cohort.worker" in child.cmdline())
    return workers


@pytest.mark.slow
def test_a_cohort_whose_workers_are_killed_is_finished_and_a_rerun_fits_nobody(study, tmp_path):
    out = tmp_path / "out"
    command = [*PROGRAM, "cohort", str(study), "-o", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.stderr.readline().strip() != "people":
            assert process.poll() is None
        begun = time.monotonic()  # the command imports for seconds before its workers start
        while not workers_of(process) and time.monotonic() < begun + 60.0:
            time.sleep(0.05)
        time.sleep(random.Random(21).uniform(0.5, 2.0))
        workers = workers_of(process)
        assert workers
        for worker in workers:
            with contextlib.suppress(psutil.NoSuchProcess):
                worker.kill()
        printed, errors = process.communicate()
    assert process.returncode == 1, errors
    assert "not fitted: Clara: walk P278 In no frame from 90.000 to 91.000 s" in " ".join(printed.split())
    people = pd.read_csv(out / "people.csv").set_index("person")
    assert people.status["Clara"] == 2
    assert set(people.status[["Anna", "Ben"]]) <= {0, 1}
    bsp = pd.read_parquet(out / "cohort.parquet")
    for name in ("Anna", "Ben"):
        alone = pd.read_csv(out / "people" / name / "bsp.csv")
        rows = bsp[bsp.person == name]
        for column in ("literature", "estimate", "sd", "information"):
            np.testing.assert_array_equal(rows[column], alone[column])
    assert not (out / "people" / "Clara").exists()
    (tmp_path / "calm").mkdir()
    fit_subject(study / "Anna" / "subject.toml").save(tmp_path / "calm")
    calm, found = hashes(tmp_path / "calm"), hashes(out / "people" / "Anna")
    with_seconds_and_command = {"fit.json", "fit.npz", "report.html", ".kinertia.json"}
    assert {name for name in calm if calm[name] != found[name]} <= with_seconds_and_command
    before = hashes(out)
    again = run("cohort", study, "-o", out)
    assert again.status == 1
    assert "3 people: 0 to fit, 3 as before" in again.out
    assert hashes(out) == before


@pytest.mark.slow
def test_a_scheduler_that_runs_already_is_used(study, tmp_path):
    from distributed import LocalCluster

    shutil.rmtree(study / "Anna")
    shutil.rmtree(study / "Ben")
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        outcome = run("cohort", study, "-o", tmp_path / "out", "--scheduler", cluster.scheduler_address)
    assert outcome.status == 1, outcome.err
    assert "not fitted: Clara: walk P278 In no frame from 90.000 to 91.000 s" in " ".join(outcome.out.split())
    assert (tmp_path / "out" / "failed" / "Clara.json").is_file()
    assert "note: " not in outcome.out
    planned = run("cohort", study, "-o", tmp_path / "out", "--dry-run")
    assert "as before: walk P278 In no frame from 90.000 to 91.000 s" in " ".join(planned.out.split())


@pytest.mark.slow
def test_workers_that_are_not_there_or_have_several_threads_are_told():
    from distributed import Client, LocalCluster

    found = []
    for workers in (0, 1):
        with (
            LocalCluster(n_workers=workers, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
            Client(cluster) as client,
        ):
            found += doubts_of_workers(client, "tcp://lab:8786")
    none, several = found
    assert none.startswith("no worker has reported to tcp://lab:8786 yet")
    assert "have up to 2 threads" in several
