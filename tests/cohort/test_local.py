"""Processes that fit a cohort on this computer: killed, too large, or no longer wanted. Workers are small programs."""

import subprocess
import sys
import time

import psutil
import pytest

from kinertia.cohort.job import Job
from kinertia.cohort.local import LocalSize, fit_here

PLENTY = 2 * 1024**3
LEAD = """
import json, os, pathlib, sys, time
def answer(job, status=0):
    record = dict(person=job["person"], status=status, sentence="", inputs="", kinertia="", trials=1, seconds=0.0)
    print(json.dumps(dict(record=record, worker=str(os.getpid()), memory_mb=1.0)), flush=True)
for line in sys.stdin:
    job = json.loads(line)
"""


def jobs(folder, *names):
    return [Job(name, folder / "subject.toml", folder, "", 1, 60.0) for name in names]


def fitted(folder, program, *names, workers=1, memory_bytes=PLENTY):
    indented = "\n".join(f"    {line}" for line in program.splitlines())
    command = [sys.executable, "-c", LEAD + indented]
    return fit_here(jobs(folder, *names), LocalSize(workers, memory_bytes), command)


def test_one_process_fits_one_person_after_another(tmp_path):
    ended = list(fitted(tmp_path, "answer(job)", "Anna", "Ben", "Clara"))
    assert [ending.record.person for ending in ended] == ["Anna", "Ben", "Clara"]
    assert len({ending.worker for ending in ended}) == 1
    assert len({ending.worker for ending in fitted(tmp_path, "time.sleep(0.3); answer(job)", "A", "B", workers=2)}) == 2


@pytest.mark.parametrize(("kills", "status"), [(2, 0), (3, 70)])
def test_whose_process_is_killed_is_tried_three_times(kills, status, tmp_path):
    program = f"""
tried = pathlib.Path(job["cohort"]) / job["person"]
with tried.open("a") as file:
    file.write("x")
if job["person"] == "Anna" and len(tried.read_text()) <= {kills}:
    os._exit(9)
answer(job)"""
    records = {ending.record.person: ending.record for ending in fitted(tmp_path, program, "Anna", "Ben")}
    assert {name: ending.status for name, ending in records.items()} == {"Anna": status, "Ben": 0}
    assert (tmp_path / "Anna").read_text() == 3 * "x"
    assert (tmp_path / "Ben").read_text() == "x"
    assert records["Anna"].inputs == ""
    if status:
        assert "was killed 3 times" in records["Anna"].sentence


def test_who_takes_more_memory_than_there_is_takes_nobody_down(tmp_path):
    program = """
if job["person"] == "Anna":
    much = bytearray(300 * 1024**2)
    time.sleep(60)
answer(job)"""
    ended = fitted(tmp_path, program, "Anna", "Ben", workers=2, memory_bytes=200 * 1024**2)
    assert {ending.record.person: ending.record.status for ending in ended} == {"Anna": 70, "Ben": 0}


def test_processes_end_with_whoever_waits_for_them(tmp_path):
    ended = fitted(
        tmp_path, "if job['person'] != 'Anna': time.sleep(60)\nanswer(job)", "Anna", "Ben", "Clara", workers=2
    )
    begun = time.monotonic()
    assert next(ended).record.person == "Anna"
    running = [process for process in psutil.Process().children() if any(LEAD in word for word in process.cmdline())]
    assert running
    ended.close()
    assert time.monotonic() - begun < 30.0
    assert not any(process.is_running() and process.status() != psutil.STATUS_ZOMBIE for process in running)


def test_a_worker_ends_with_its_input():
    """Whatever has become of the command."""
    command = [sys.executable, "-m", "kinertia.cohort.worker"]
    assert subprocess.run(command, input="", capture_output=True, text=True, timeout=60).returncode == 0
