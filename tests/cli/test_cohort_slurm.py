"""`kinertia cohort --slurm`: how SLURM is asked for workers, and a real one on this machine."""

import os
import subprocess
import sys
import time

import pandas as pd
import pytest

from cohort_faults import write_study
from command_line import PROGRAM, run
from kinertia.errors import FileError
from kinertia.io.slurm_file import read_slurm


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


def test_without_slurm_it_says_what_to_do(tmp_path, measured_walk, monkeypatch):
    (tmp_path / "slurm.toml").write_text("", encoding="utf-8")
    (tmp_path / "people.csv").write_text(f"subject\n{measured_walk / 'subject.toml'}\n", encoding="utf-8")
    monkeypatch.setattr("kinertia.studies.cohort_slurm.which", lambda name: None)
    command = ("cohort", tmp_path / "people.csv", "-o", tmp_path / "out", "--slurm", tmp_path / "slurm.toml")
    outcome = run(*command)
    assert outcome.status == 2
    assert "there is no sbatch here; run the command on a login node" in outcome.err
    outcome = run(*command, "--scheduler", "tcp://x:1")
    assert outcome.status == 2
    assert "--scheduler and --slurm: give one of them" in outcome.err
    outcome = run(*command, "--dry-run")
    assert "On SLURM, in 1 jobs of 4 GB" in " ".join(outcome.out.split())


@pytest.mark.slow
def test_a_cohort_runs_on_a_real_slurm_also_when_a_job_is_ended(tmp_path):
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
        found["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "env": found, "cwd": tmp_path}
        with subprocess.Popen(command, **pipes) as process:
            while not (out / "failed" / "Anna.log").exists():  # as long as somebody is at work
                assert process.poll() is None
                time.sleep(0.05)
            subprocess.run(["scancel", "1"], env=found, check=True)
            printed, _ = process.communicate(timeout=300)
    assert process.returncode in (0, 1), printed
    assert pd.read_csv(out / "people.csv").status.tolist() == [process.returncode]
    assert (out / "people" / "Anna" / "report.html").is_file()
    assert not list(tmp_path.glob("slurm-*.out"))
