"""Failures of Kinertia itself and trouble of the system: one line, a status, a log."""

import json
from importlib.metadata import version

import pytest

from command_line import run
from kinertia.errors import internal_error


def test_a_failure_of_kinertia_is_one_line_a_status_and_a_log(tmp_path, monkeypatch):
    def fail(_):
        raise ZeroDivisionError("division by\nzero")

    monkeypatch.setattr("kinertia.cli.check.check_subject", lambda *_: fail(0))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    outcome = run("check", "wälk.trc")
    assert outcome.status == 70
    assert outcome.out == ""
    (line,) = outcome.err.splitlines()
    (log,) = tmp_path.iterdir()
    assert line == f"error: {internal_error('ZeroDivisionError: division by zero', log)}"
    text = log.read_text(encoding="utf-8")
    for part in ("wälk.trc", f"kinertia {version('kinertia')}", "Traceback", "in fail", "numpy"):
        assert part in text


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device"), "error: No space left on device; check the path"),
        (OSError("gone"), "error: gone; check the path"),
    ],
)
def test_trouble_of_the_system_without_a_file(monkeypatch, error, line):
    def full(*_):
        raise error

    monkeypatch.setattr("kinertia.cli.check.check_subject", full)
    outcome = run("check", "walk.trc")
    assert outcome.status == 2
    assert outcome.err.startswith(line)


@pytest.mark.parametrize(
    "given",
    [
        ("check",),
        ("fit", "--bogus"),
        ("fit", "walk.c3d", "--mass", "abc"),
        ("check", "walk.c3d", "--waive", "X999"),
        ("explain", "P999"),
        ("nothing",),
    ],
    ids=" ".join,
)
def test_an_error_of_usage_is_json_for_scripts(given):
    outcome = run(*given, "--json")
    assert outcome.status == 2
    content = json.loads(outcome.out)
    assert content["findings"] == []
    assert content["error"]
    assert outcome.err == f"error: {content['error']}\n"


@pytest.mark.parametrize(("error", "status"), [(OSError("gone"), 2), (ZeroDivisionError("division by zero"), 70)])
def test_failures_are_json_for_scripts(monkeypatch, error, status):
    def fail(*_):
        raise error

    monkeypatch.setattr("kinertia.cli.check.check_subject", fail)
    outcome = run("check", "walk.trc", "--json")
    assert outcome.status == status
    content = json.loads(outcome.out)
    assert content["findings"] == []
    assert outcome.err == f"error: {content['error']}\n"


def test_help_is_no_error_of_usage():
    assert run("check", "--json", "--help").out.lstrip().startswith("Usage: kinertia check")


def test_trouble_with_the_disk_is_one_line(person, monkeypatch):
    def denied(*_, **__):
        raise PermissionError(13, "Permission denied", "/somewhere")

    monkeypatch.setattr("kinertia.io.subject.person_recordings.read_recording", denied)
    outcome = run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", "-o", person / "out")
    assert outcome.status == 2
    assert outcome.err.splitlines()[-1].startswith("error: /somewhere: Permission denied; check")
    assert not (person / "out").exists()
