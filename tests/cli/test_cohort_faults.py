"""Cohorts whose command, scheduler, disk or reader of files fails: a rerun finishes all, byte for byte."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from cohort_faults import HANGING, write_study
from command_line import PROGRAM, run
from kinertia.cohort.job import Job
from kinertia.cohort.local import LocalSize, fit_here
from kinertia.cohort.record import Place, inputs_of, prepare_folder
from kinertia.io.subject.reader import read_subject

TESTS = Path(__file__).resolve().parents[1]
COMMAND = [*PROGRAM, "cohort"]
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs fork and kill -9")


def with_tests():
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])}


def may_mount():
    asked = ["unshare", "-rm", "true"]
    return bool(shutil.which("unshare")) and subprocess.run(asked, capture_output=True).returncode == 0


@posix
@pytest.mark.slow
@pytest.mark.first
def test_killed_at_20_random_moments_and_on_full_disks_all_are_finished_byte_for_byte(tmp_path):
    apart = ["unshare", "-rm"] if may_mount() else []
    command = [*apart, sys.executable, TESTS / "cohort_kills.py", tmp_path, "20", "21"]
    done = subprocess.run(command, capture_output=True, text=True, env=with_tests())
    assert done.returncode == 0, done.stderr
    early, with_people, *disks = json.loads(done.stdout)
    assert early >= 10, "most kills must fall before a run has ended"
    assert with_people >= 3, "kills must also fall after people were finished"
    if not apart:
        pytest.skip("full disks need a file system of one's own (unshare -rm)")
    assert [status for status, _ in disks] == [2, 1, 2]
    assert all("No space left on device" in words for _, words in disks)


@posix
@pytest.mark.slow
@pytest.mark.parametrize("wait_s", [0.3, 0.8, 1.3])
def test_interrupted_while_workers_start_it_ends_without_a_traceback(wait_s, tmp_path):
    """A terminal sends Ctrl-C to all of them: the command, and processes that have not yet learnt to leave it to it."""
    study = write_study(tmp_path / "study", ("Anna", "Ben"))
    command = [*COMMAND, str(study), "-o", str(tmp_path / "out")]
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    handled = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # where the tests themselves run in the background
    with subprocess.Popen(command, **piped, start_new_session=True, preexec_fn=handled) as process:
        assert process.stderr.readline().strip() == "looking for changes"
        time.sleep(wait_s)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert set(errors.split("\n")) <= {"people", ""}


@pytest.mark.slow
def test_a_person_whose_files_hang_the_reader_is_given_up_and_the_others_are_fitted(tmp_path):
    study, cohort = write_study(tmp_path / "study", ("Anna", HANGING)), tmp_path / "out"
    prepare_folder(cohort)
    jobs = []
    for name, limit_s in ((HANGING, 2.0), ("Anna", 600.0)):
        subject = study / name / "subject.toml"
        jobs.append(Job(name, subject, cohort, inputs_of(read_subject(subject)), 1, limit_s))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", with_tests()["PYTHONPATH"])
        ended = list(fit_here(jobs, LocalSize(1, 2 * 1024**3), [sys.executable, "-m", "cohort_faults"]))
    records = {ending.record.person: ending.record for ending in ended}
    assert records["Anna"].fitted
    lost = records[HANGING]
    assert (lost.status, lost.inputs) == (70, "")
    assert "did not finish within 0 min and was stopped" in lost.sentence
    assert "in hang" in Place(cohort, HANGING).log.read_text(encoding="utf-8")
    assert not Place(cohort, HANGING).results.exists()


def waiting_jobs(address):
    from distributed import Client

    with Client(address) as client:
        return client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))


@posix
@pytest.mark.slow
def test_a_scheduler_that_is_killed_ends_the_command_and_the_next_run_finishes(tmp_path):
    study, out = write_study(tmp_path / "study", ("Anna",)), tmp_path / "out"
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1"]
    start += ["--port", "0", "--no-jupyter", "--scheduler-file", str(tmp_path / "scheduler.json")]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(start, **quiet) as scheduler:
        while not (tmp_path / "scheduler.json").exists():
            assert scheduler.poll() is None
            time.sleep(0.05)
        address = json.loads((tmp_path / "scheduler.json").read_text(encoding="utf-8"))["address"]
        # nobody works there, so that the moment is before the end
        command = [*COMMAND, str(study), "-o", str(out), "--scheduler", address]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            while not waiting_jobs(address):
                assert process.poll() is None
            scheduler.kill()
            _, errors = process.communicate(timeout=120)
    assert process.returncode == 2, errors
    assert "lost the Dask scheduler; finished results are kept: run the command again" in errors
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        outcome = run("cohort", study, "-o", out, "--scheduler", cluster.scheduler_address)
    assert outcome.status in (0, 1), outcome.err
    assert pd.read_csv(out / "people.csv").status.tolist() == [outcome.status]
