"""People in line: order, progress, cancelling, crashes. Workers are small programs that do as the real one does."""

import sys
import time
from contextlib import contextmanager

import psutil
import pytest

pytest.importorskip("starlette", reason="needs the extra app (pip install -e '.[test]')")

from kinertia.cli.web import jobs as jobs_module
from kinertia.cli.web.jobs import Jobs
from kinertia.cli.web.library import Library, PersonFolder
from kinertia.cli.web.person_page import progress
from kinertia.errors import internal_error

_PATIENCE_S = 30


@pytest.fixture
def library(tmp_path):
    return Library(tmp_path / "library")


@pytest.fixture
def worker(monkeypatch):
    """Replaces the worker by a program; `folder` and `say` are defined in it."""

    def replace(program):
        lead = (
            "import json, pathlib, sys, time, os\nfolder = pathlib.Path(sys.argv[-1])\n"
            "def say(**told): print(json.dumps(told), flush=True)\n"
        )
        monkeypatch.setattr(jobs_module, "WORKER", (sys.executable, "-c", lead + program))

    return replace


def until(condition):
    ends = time.monotonic() + _PATIENCE_S
    while not condition():
        assert time.monotonic() < ends, "it did not come about"
        time.sleep(0.02)


@contextmanager
def fitting(library, *names):
    """Jobs at work, and new people of these names whose fits wait there in this order."""
    people, jobs = [library.add(name) for name in names], Jobs()
    with jobs.at_work():
        for person in people:
            jobs.add(person, "fit")
        yield jobs, *people


def test_how_a_fit_ended_is_noted_before_it_leaves_the_queue(library, worker, monkeypatch):
    """A page made in between would show neither progress nor an error, and would never look again."""
    worker("os.abort()")
    jobs, person, queued, note = Jobs(), library.add("A"), [], PersonFolder.note

    def noting(noted, **values):
        queued.append(jobs.busy(noted))
        note(noted, **values)

    with jobs.at_work():
        jobs.add(person, "fit")
        monkeypatch.setattr(PersonFolder, "note", noting)
        until(lambda: not jobs.busy(person))
    assert queued == [True]
    assert person.notes()["fit"]["how"] == "failed"


def test_people_are_done_one_after_the_other(library, worker):
    worker("(folder.parent / 'order').open('a').write(folder.name + ' '); time.sleep(0.1)")
    people, jobs = [library.add(name) for name in ("C", "A", "B")], Jobs()
    for person in people:
        jobs.add(person, "fit")
        jobs.add(person, "fit")
    assert [jobs.place(jobs.of(person, "fit")) for person in people] == [0, 1, 2]
    assert progress(people[2], jobs)["fit"]["stage"] == "waiting for 2 others"
    with jobs.at_work():
        until(lambda: not any(map(jobs.busy, people)))
    assert (library.folder / "order").read_text().split() == ["C", "A", "B"]
    assert [person.notes()["fit"] for person in people] == [{}, {}, {}]


def test_progress_and_time_left_are_of_the_stage(library, worker):
    worker("say(stage='estimate', share=0.25)\nwhile not (folder / 'go').exists(): time.sleep(0.02)")
    with fitting(library, "Anna") as (jobs, person):
        until(lambda: progress(person, jobs)["fit"]["share"] == 0.25)
        told = progress(person, jobs)
        assert told["fit"]["stage"] == "estimate"
        assert told["fit"]["left"].startswith("about ")
        assert told["check"] is None
        (person.folder / "go").touch()
        until(lambda: not jobs.busy(person))


def test_an_error_in_the_files_is_the_persons_note(library, worker):
    worker("say(error='walk.c3d: no force plate in it'); sys.exit(2)")
    with fitting(library, "Anna") as (jobs, person):
        until(lambda: not jobs.busy(person))
    assert person.notes()["fit"] == {"how": "failed", "message": "walk.c3d: no force plate in it"}


def test_a_crash_takes_neither_the_page_nor_the_next_one_down(library, worker):
    worker(
        "if folder.name == 'Anna':\n    print('a bug', file=sys.stderr)\n    os.abort()\nsay(stage='done', share=1.0)"
    )
    with fitting(library, "Anna", "Ben") as (jobs, anna, ben):
        until(lambda: not jobs.busy(ben))
    assert anna.notes()["fit"]["message"] == internal_error("a bug", anna.folder / "failure.log")
    assert ben.notes()["fit"] == {}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not tell who ended a process")
def test_a_fit_that_was_killed_is_no_failure_of_ours(library, worker):
    worker("import signal\nos.kill(os.getpid(), signal.SIGKILL)")
    with fitting(library, "Anna") as (jobs, person):
        until(lambda: not jobs.busy(person))
    assert "operating system ended it" in person.notes()["fit"]["message"]
    assert "memory" in person.notes()["fit"]["message"]
    assert not (person.folder / jobs_module.LOG).exists()


def test_the_log_of_a_failure_is_none_of_the_files_and_goes_with_the_next_success(library, worker):
    worker("if not (folder / 'sound').exists(): os.abort()")
    with fitting(library, "Anna") as (jobs, person):
        until(lambda: not jobs.busy(person))
        assert (person.folder / jobs_module.LOG).is_file()
        assert person.files() == []
        (person.folder / "sound").touch()
        jobs.add(person, "fit")
        until(lambda: not jobs.busy(person))
    assert not (person.folder / jobs_module.LOG).exists()


def test_who_waits_and_who_is_at_work_are_cancelled(library, worker):
    worker("say(stage='estimate', share=0.1); time.sleep(60)")
    with fitting(library, "Anna", "Ben") as (jobs, anna, ben):
        until(lambda: progress(anna, jobs)["fit"]["stage"] == "estimate")
        process = psutil.Process(jobs.of(anna, "fit")._process.pid)
        jobs.cancel(ben, "fit")
        jobs.cancel(anna, "fit")
        assert not jobs.busy(anna)
        assert not jobs.busy(ben)
        assert not process.is_running()
    assert anna.notes()["fit"] == ben.notes()["fit"] == {"how": "cancelled"}


def test_what_is_at_work_when_the_server_ends_is_interrupted(library, worker):
    worker("say(stage='estimate', share=0.1); time.sleep(60)")
    with fitting(library, "Anna", "Ben") as (jobs, anna, ben):
        until(lambda: progress(anna, jobs)["fit"]["stage"] == "estimate")
        process = psutil.Process(jobs.of(anna, "fit")._process.pid)
    assert not process.is_running()
    assert anna.notes()["fit"] == ben.notes()["fit"] == {"how": "interrupted"}


def test_a_check_does_not_wait_for_fits(library, worker):
    worker("time.sleep(60 if sys.argv[1] == 'fit' else 0)")
    with fitting(library, "Anna") as (jobs, person):
        jobs.add(person, "check")
        until(lambda: jobs.of(person, "check") is None)
        assert jobs.of(person, "fit") is not None


def test_fits_wait_for_what_is_compiled_once_and_its_end_ends_it(library, worker, monkeypatch):
    monkeypatch.setattr(jobs_module, "is_compiled", lambda: False)
    worker("say(stage='compiling, once', share=0.5)\nif sys.argv[1] == 'prepare': time.sleep(60)")
    person = library.add("Anna")
    jobs = Jobs(prepare=True)
    with jobs.at_work():
        jobs.add(person, "fit")
        until(lambda: jobs.preparing.share == 0.5)
        told = progress(person, jobs)["fit"]
        assert (told["stage"], told["share"]) == ("preparing this computer for its first estimate", 0.5)
        assert told["left"].startswith("about ")
    assert jobs.preparing is None
    assert person.notes()["fit"] == {"how": "interrupted"}


def test_a_fit_that_was_asked_for_meanwhile_begins_when_all_is_compiled(library, worker, monkeypatch):
    monkeypatch.setattr(jobs_module, "is_compiled", lambda: False)
    order = str(library.folder / "order")
    worker(f"open({order!r}, 'a').write(sys.argv[1] + ' ')")
    person, jobs = library.add("Anna"), Jobs(prepare=True)
    jobs.add(person, "fit")
    with jobs.at_work():
        until(lambda: not jobs.busy(person))
    assert (library.folder / "order").read_text().split() == ["prepare", "fit"]
    assert person.notes()["fit"] == {}


def test_the_time_left_falls_until_the_next_share_is_told(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(jobs_module.time, "monotonic", lambda: now[0])
    work = jobs_module.Work()
    work._moved("compiling, once", 0.0)
    assert work.seconds_left() is None
    now[0] = 8.0
    work._moved("compiling, once", 0.4)
    assert work.seconds_left() == pytest.approx(12.0)
    now[0] = 13.0
    assert work.seconds_left() == pytest.approx(7.0)
    now[0] = 60.0
    assert work.seconds_left() == 1.0


def test_nothing_is_prepared_where_all_is_compiled(monkeypatch):
    monkeypatch.setattr(jobs_module, "is_compiled", lambda: True)
    assert Jobs(prepare=True).preparing is None
