"""The current folder holds somebody's data: a `statistics.py` or `coverage.py` there is never imported."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import PROGRAM
from kinertia.cli.compiling import _beside
from kinertia.cli.web.jobs import WORKER as PAGE_WORKER
from kinertia.cohort.job import Job
from kinertia.cohort.local import WORKER as COHORT_WORKER
from kinertia.cohort.local import Process
from kinertia.cohort.record import Place
from kinertia.studies.parallel import in_parallel

TRACE = "imported"
OF_PACKAGES = ("coverage", "numpy", "scipy", "pydantic", "typer", "psutil", "ezc3d", "yaml", "IPython")
"""Those that Kinertia needs, and those that its packages take where they are installed."""


@pytest.fixture
def traps(tmp_path, monkeypatch) -> Path:
    """A folder where every module of Python, and some others, leave a trace: the current one, and the user's home."""
    folder = tmp_path / "data"
    folder.mkdir()
    code = f"open({str(folder / TRACE)!r}, 'a').write(__name__ + ' ')\nraise ImportError('of ' + __file__)\n"
    for name in {*sys.stdlib_module_names, *OF_PACKAGES} - set(sys.builtin_module_names):
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
    monkeypatch.chdir(folder)
    for home in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(home, str(folder))
    return folder


def loaded_to_start() -> set[str]:
    """Modules that Python itself and the package's door take before anything can be said about the current folder."""
    program = "import runpy, pkgutil, kinertia, sys, json; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in json.loads(done.stdout)}


def test_a_trap_leaves_a_trace(traps):
    subprocess.run([sys.executable, "-c", "import statistics"], capture_output=True, check=False)
    assert (traps / TRACE).read_text() == "statistics "


@pytest.mark.slow
@pytest.mark.parametrize("command", [("check",), ("fit", "-o", "out")], ids=lambda command: command[0])
def test_commands(traps, c3d_lab, command):
    for name in loaded_to_start():
        (traps / f"{name}.py").unlink(missing_ok=True)
    assert {"statistics.py", "coverage.py", "random.py", "numpy.py"} <= {path.name for path in traps.iterdir()}
    done = subprocess.run([*PROGRAM, *command, str(c3d_lab / "subject.toml")], capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    assert not (traps / TRACE).exists(), (traps / TRACE).read_text()


def test_what_compiles_beside(traps):
    with _beside(2):
        pass
    assert not (traps / TRACE).exists(), (traps / TRACE).read_text()


def test_the_worker_of_the_page(traps):
    with Process([*PAGE_WORKER, "prepare"]) as process:
        assert process.status() == 0, process.log
    assert not (traps / TRACE).exists(), (traps / TRACE).read_text()


@pytest.mark.slow
def test_the_worker_of_cohorts(traps, c3d_lab):
    cohort = traps / "cohort"
    place = Place(cohort, "walker")
    for folder in (place.results.parent, place.log.parent):
        folder.mkdir(parents=True)
    with Process(COHORT_WORKER) as process:
        process.ask(Job("walker", c3d_lab / "subject.toml", cohort, "", 1, 60.0).text)
        answer = next(process.answers())
    assert answer["record"]["status"] in (0, 1), answer["record"]["sentence"]
    assert not (traps / TRACE).exists(), (traps / TRACE).read_text()


def test_processes_of_studies(traps):
    assert in_parallel(abs, [-3, 1], workers=2) == [3, 1]
    assert not (traps / TRACE).exists(), (traps / TRACE).read_text()
