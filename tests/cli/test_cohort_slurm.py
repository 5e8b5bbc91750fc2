"""`kinertia cohort --slurm`: how SLURM is asked for workers, and a real one on this machine."""

import os
import subprocess
import sys
import time

import pandas as pd
import pytest

import fake_slurm
from cohort_faults import write_study
from command_line import PROGRAM, run
from kinertia.cohort.cluster import ENVIRONMENT, SlurmFile, read_slurm, run_jobs, slurm_cluster
from kinertia.cohort.job import Job
from kinertia.errors import FileError, KinertiaError


def test_the_file_says_what_to_ask_for(tmp_path):
    path = tmp_path / "slurm.toml"
    path.write_text('workers = 40\npartition = "short"\nbefore = ["module load python"]\n', encoding="utf-8")
    wanted = read_slurm(path)
    assert (wanted.workers, wanted.partition, wanted.before) == (40, "short", ("module load python",))
    assert (wanted.memory_gb, wanted.account) == (4.0, None)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ('workers = 4\nqueue = "short"\n', 2, "unknown entry 'queue'; known are workers, memory_gb, time, partition"),
        ("workers = 0\n", 1, "workers: "),
        ('memory_gb = "much"\n', 1, "memory_gb: "),
    ],
)
def test_what_cannot_be_asked_for_says_where(text, line, words, tmp_path):
    path = tmp_path / "slurm.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=words) as caught:
        read_slurm(path)
    assert caught.value.line == line


def test_without_slurm_it_says_what_to_do(tmp_path, c3d_lab, monkeypatch):
    (tmp_path / "slurm.toml").write_text("", encoding="utf-8")
    (tmp_path / "people.csv").write_text(f"subject\n{c3d_lab / 'subject.toml'}\n", encoding="utf-8")
    monkeypatch.setattr("kinertia.cohort.cluster.which", lambda name: None)
    command = ("cohort", tmp_path / "people.csv", "-o", tmp_path / "out", "--slurm", tmp_path / "slurm.toml")
    outcome = run(*command)
    assert outcome.status == 2
    assert "there is no sbatch here; run the command on a login node" in outcome.err
    outcome = run(*command, "--scheduler", "tcp://x:1")
    assert outcome.status == 2
    assert "--scheduler and --slurm: give one of them" in outcome.err
    outcome = run(*command, "--dry-run")
    assert "On SLURM, in 1 jobs of 4 GB" in " ".join(outcome.out.split())


@pytest.fixture
def slurm_that(tmp_path, monkeypatch):
    """Commands of SLURM on the path, with what becomes of each job; looked at often."""
    if sys.platform == "win32":
        pytest.skip("SLURM is not Windows'")

    def that(*answers):
        folder = fake_slurm.fake_slurm(tmp_path / "bin", list(answers))
        monkeypatch.setenv("PATH", os.pathsep.join([str(folder), os.environ["PATH"]]))
        monkeypatch.setattr("kinertia.cohort.cluster.LOOK_S", 0.1)
        return folder

    return that


def test_jobs_that_sbatch_refuses_are_told_at_once(slurm_that):
    slurm_that("refused")
    with pytest.raises(KinertiaError, match=f"sbatch refused the job: {fake_slurm.REFUSAL}"):  # noqa: SIM117
        with slurm_cluster(SlurmFile(partition="long"), 1):
            pytest.fail("there is no cluster")


@pytest.mark.slow
@pytest.mark.parametrize("kept", [True, False])
def test_jobs_of_which_none_reports_are_given_up_with_what_they_said(slurm_that, tmp_path, kept):
    folder = slurm_that("ends", "refused", "ends")
    wanted = SlurmFile(workers=2, logs=str(tmp_path / "logs") if kept else None)
    words = r"\d SLURM jobs ended before their workers reported .*1 more were refused by sbatch.* and none did; likely "
    words += f".*log says: {fake_slurm.LAST_WORDS}" if kept else '.*logs = "slurm-logs"'
    with pytest.raises(KinertiaError, match=words), slurm_cluster(wanted, 5) as client:
        list(run_jobs(client, len, [Job("Anna", tmp_path, tmp_path, "", 1, 60.0)]))
    assert len(list(folder.glob("*.job"))) >= 6


@pytest.mark.slow
def test_a_job_that_ends_before_its_worker_reports_is_asked_for_again(slurm_that):
    folder = slurm_that("ends", "ends", "runs")
    with slurm_cluster(SlurmFile(workers=1, memory_gb=1.0), 5) as client:
        found = client.submit(os.getenv, "MALLOC_TRIM_THRESHOLD_").result(timeout=120)
    assert found == str(ENVIRONMENT["MALLOC_TRIM_THRESHOLD_"])
    assert len(list(folder.glob("*.job"))) == 3


@pytest.mark.slow
def test_a_cohort_runs_on_a_real_slurm_also_when_a_job_is_ended(tmp_path, monkeypatch):
    if sys.platform != "linux":
        pytest.skip("needs SLURM, which is Linux's")
    from slurm_here import lacking, slurm_here

    if reason := lacking():
        pytest.skip(reason)
    study, out = write_study(tmp_path / "study", ("Anna",)), tmp_path / "out"
    (tmp_path / "slurm.toml").write_text('workers = 1\nmemory_gb = 1\ntime = "00:10:00"\n', encoding="utf-8")
    command = [*PROGRAM, "cohort", str(study)]
    command += ["-o", str(out), "--slurm", str(tmp_path / "slurm.toml")]
    with slurm_here(tmp_path / "slurm") as found:
        _dies_once_and_is_replaced(found, tmp_path, monkeypatch)
        found["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "env": found, "cwd": tmp_path}
        with subprocess.Popen(command, **pipes) as process:
            while not (out / "failed" / "Anna.log").exists():  # as long as somebody is at work
                assert process.poll() is None
                time.sleep(0.05)
            queue = ["squeue", "--noheader", "--format=%A"]
            (job,) = subprocess.run(queue, env=found, check=True, capture_output=True, text=True).stdout.split()
            subprocess.run(["scancel", job], env=found, check=True)
            printed, _ = process.communicate(timeout=300)
    assert process.returncode in (0, 1), printed
    assert pd.read_csv(out / "people.csv").status.tolist() == [process.returncode]
    assert (out / "people" / "Anna" / "report.html").is_file()
    assert not list(tmp_path.glob("slurm-*.out"))


def _dies_once_and_is_replaced(found, folder, monkeypatch):
    """The first job ends before there is a worker."""
    for name in ("PATH", "SLURM_CONF"):
        monkeypatch.setenv(name, found[name])
    monkeypatch.setattr("kinertia.cohort.cluster.LOOK_S", 1.0)
    dies_once = f"test -e {folder}/died || {{ touch {folder}/died; exit 1; }}"
    with slurm_cluster(SlurmFile(workers=1, memory_gb=1.0, before=(dies_once,)), 1) as client:
        assert client.submit(abs, -3).result(timeout=120) == 3
    assert (folder / "died").exists()
