"""Terminals and pipes that are not UTF-8, as on Windows: a letter that they lack never ends a command."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from command_line import run, run_apart
from kinertia.cli import demo as demo_module
from kinertia.cli import learning
from kinertia.io.subject.learnt_files import read_session
from reference import commands

NAME = "größe→ 歩行"


SEVERAL = """
import json, sys
from kinertia.cli.start import main
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["kinertia", *arguments]
    try:
        main()
    except SystemExit as end:
        for stream in (sys.stdout, sys.stderr):
            print(END, end.code or 0, file=stream, flush=True)
"""
"""Runs command lines one after the other: starting Python takes longer than they do."""


END = "--- ended with"


@pytest.fixture(scope="module", params=[pytest.param("ascii", marks=pytest.mark.slow), "cp1252"])
def encoding(request):
    return request.param


@pytest.fixture(scope="module")
def folder(tmp_path_factory, c3d_lab):
    folder = tmp_path_factory.mktemp("terminal") / NAME
    folder.mkdir()
    shutil.copyfile(c3d_lab / "walk.c3d", folder / f"{NAME}.c3d")
    return folder


@pytest.fixture(scope="module")
def done(encoding, folder):
    """Help, results and an error: status and what stood on both streams."""
    lines = ["--help"], ["check", str(folder / f"{NAME}.c3d"), "-o", str(folder / "out")], ["check", f"{NAME}.c3d"]
    command = [sys.executable, "-c", f"END = {END!r}{SEVERAL}", json.dumps(lines)]
    ended = subprocess.run(
        command, env=os.environ | {"PYTHONIOENCODING": encoding}, capture_output=True, encoding=encoding, check=False
    )
    assert ended.returncode == 0, ended.stderr
    streams = [re.split(rf"{END} (\d+)\n", stream)[:-1] for stream in (ended.stdout, ended.stderr)]
    return [
        SimpleNamespace(returncode=int(status), stdout=out, stderr=err)
        for out, status, err in zip(streams[0][::2], streams[0][1::2], streams[1][::2], strict=True)
    ]


def test_help(done):
    assert done[0].returncode == 0, done[0].stderr
    assert "Body segment parameters from gait" in done[0].stdout


def test_results_with_letters_that_it_lacks(encoding, done, folder):
    assert "Traceback" not in done[1].stderr
    assert done[1].returncode in (0, 1)
    assert f"page in {folder / 'out' / 'check.html'}".encode(encoding, "replace").decode(encoding) in done[1].stdout


def test_errors_with_letters_that_it_lacks(done):
    assert done[2].returncode == 2
    assert done[2].stderr.splitlines()[-1].startswith("error: ")
    assert "F101 " in done[2].stderr
    assert "Traceback" not in done[2].stderr


@pytest.mark.slow
def test_a_whole_fit(encoding, c3d_lab, tmp_path):
    done = run_apart("fit", c3d_lab / "subject.toml", "-o", tmp_path / NAME, encoding=encoding)
    assert done.status == 0, done.err
    assert "results in" in done.out
    assert (tmp_path / NAME / "report.html").is_file()


def test_a_process_ends_in_order():
    """All is written, and what is to be done at the end of a process is done."""
    program = (
        "import atexit, sys; from kinertia.cli.start import program; "
        "atexit.register(lambda: print('at its end')); sys.argv = ['kinertia', 'fit', 'none.toml']; "
        "print('before'); program()"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.split("\n")) == (2, ["before", "at its end", ""])
    assert re.fullmatch(r"error: .*none\.toml: F101 .*\n", ended.stderr)


def told(*arguments, status=0):
    """What a command prints, which is JSON from the first letter to the last."""
    outcome = run(*arguments, "--json")
    assert outcome.status == status or (status is None and outcome.status in (0, 1)), outcome.err
    return json.loads(outcome.out, parse_constant=pytest.fail)


def test_every_command_has_the_option():
    lacking = {
        name for name, command in commands() if not any("--json" in parameter.opts for parameter in command.params)
    }
    groups = {name for name, command in commands() if getattr(command, "commands", None)}
    assert lacking <= groups | {"kinertia"}


def test_init_says_what_is_to_be_filled_in(tmp_path, c3d_lab):
    for name in ("static.c3d", "walk.c3d"):
        shutil.copyfile(c3d_lab / name, tmp_path / name)
    content = told("init", tmp_path)
    text = (tmp_path / "subject.toml").read_text(encoding="utf-8")
    assert content["subject_file"] == str(tmp_path / "subject.toml")
    assert content["fill_in"] == [line.split()[1] for line in text.splitlines() if "FILL IN:" in line] == ["sex"]


def test_markers_says_which_preset_is_recognised(c3d_lab, tmp_path):
    content = told("markers", c3d_lab / "static.c3d", "-o", tmp_path / "own.toml")
    assert content["recognised"] == "plug-in-gait"
    assert {"LASI", "RASI"} <= set(content["labels"])
    assert content["draft"] == str(tmp_path / "own.toml")
    shown = run("markers", c3d_lab / "static.c3d").out
    for preset in content["presets"]:
        assert f"{preset['labels'] - len(preset['absent'])} of {preset['labels']}" in shown


def test_check_says_what_it_shows_and_fails_as_without(c3d_lab, tmp_path):
    content = told("check", c3d_lab / "walk.c3d")
    assert content["recordings"][0]["name"] == "walk"
    assert (content["verdict"], content["rules_run"] > 100) == (["use"], True)
    content = told("check", c3d_lab / "walk.c3d", "--mass", 90, status=1)
    (found,) = [reported for reported in content["findings"] if reported["severity"] == "ERROR"]
    assert (found["code"], found["status"], found["evidence"]["stated_kg"]["value"]) == ("S111", "open", 90)
    (tmp_path / "broken.c3d").write_bytes(b"no motion" * 100)
    content = told("check", tmp_path / "broken.c3d", status=2)
    assert [finding["code"] for finding in content["findings"]] == ["F103"]


def test_demo_sets_the_estimate_beside_the_truth(demo_run, tmp_path, monkeypatch):
    demo, folder = demo_run
    monkeypatch.setattr(demo_module, "run_demo", lambda *arguments, **options: demo)
    content = told("demo", "-o", tmp_path / "out")
    summary = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
    assert {key: content[key] for key in summary} == summary
    errors = content["truth"]["rms_errors"]
    assert tuple(errors["estimate"].values()) == pytest.approx(demo.rms_errors(demo.fit.estimate))
    assert errors["estimate"]["mass_kg"] < errors["literature"]["mass_kg"]
    knee = content["truth"]["moment_rms_errors_Nm"]["knee"]
    assert knee["estimate"] < knee["usual_pipeline"]


def test_the_measured_demo_is_a_fit(measured_demo, tmp_path, monkeypatch):
    monkeypatch.setattr(demo_module, "run_measured_demo", lambda folder, progress: measured_demo.fit)
    content = told("demo", "--measured", "-o", tmp_path / "out", status=measured_demo.outcome.status)
    summary = json.loads((measured_demo.folder / "fit.json").read_text(encoding="utf-8"))
    assert {key: content[key] for key in summary} == summary


def test_fit_has_the_rows_of_its_table(demo_run, tmp_path, few_evaluations):
    content = told("fit", demo_run[1] / "lab", "--method", "two-level", "-o", tmp_path / "out", status=None)
    table = pd.read_csv(tmp_path / "out" / "bsp.csv")
    rows = pd.DataFrame(content["bsp"])
    assert list(rows) == list(table)
    np.testing.assert_allclose(rows.estimate, table.estimate, rtol=1e-9)


def test_instruments_says_what_its_file_holds(measured_demo, c3d_lab, tmp_path, monkeypatch):
    monkeypatch.setattr(learning, "fit_subject", lambda wanted, *_: measured_demo.fit)
    content = told("instruments", c3d_lab / "subject.toml", "-o", tmp_path / "instruments.toml")
    (person,) = read_session(Path(content["file"]))
    assert content["people"] == [person.name]
    gain = next(entry for entry in content["found"] if entry["quantity"] == "gain")
    written = (tmp_path / "instruments.toml").read_text(encoding="utf-8")
    assert f"gain_percent = {100 * gain['value']:.3f}"[:-2] in written


def test_report_and_export_name_their_files(demo_run, tmp_path):
    results, tables = tmp_path / "results", tmp_path / "tables"
    results.mkdir()
    shutil.copy(demo_run[1] / "fit.npz", results)
    assert told("report", results) == {"report": str(results / "report.html"), "norms": [], "without_curve": []}
    (tmp_path / "norms.csv").write_text("quantity,percent,mean,sd\nknee_angle_moment,0,0,1\nkneecap,0,0,1\n")
    content = told("report", results, "--norms", tmp_path / "norms.csv")
    assert (content["norms"], content["without_curve"]) == (["knee_angle_moment"], ["kneecap"])
    content = told("export", results, "--csv", "-o", tables)
    assert content["folder"] == str(tables)
    assert {"bsp.csv", "tables.json", "walk/moments.csv"} <= set(content["files"])
    assert all((tables / name).is_file() for name in content["files"])


def test_warm_up_says_where_it_is_compiled():
    content = told("warm-up")
    assert content["compiled_before"] is True
    assert "kinertia" in content["folder"]


def test_app_prints_its_address_first(monkeypatch, tmp_path):
    pytest.importorskip("uvicorn")
    from kinertia.cli.web.server import Server

    monkeypatch.setattr(Server, "run", lambda self: self._socket.close())
    content = told("app", "--folder", tmp_path, "--no-browser")
    assert content["address"].startswith("http://127.0.0.1:")
    assert content["library"] == str(tmp_path)


def test_an_error_is_json_and_a_line(tmp_path):
    outcome = run("init", tmp_path, "--json")
    content = json.loads(outcome.out)
    assert (outcome.status, outcome.err) == (2, f"error: {content['error']}\n")
    (found,) = content["findings"]
    assert (found["code"], found["where"]) == ("F108", {"file": tmp_path.name})


def test_words_come_back_after_a_command_for_scripts(c3d_lab):
    told("markers", c3d_lab / "static.c3d")
    assert "plug-in-gait is recognised by itself" in run("markers", c3d_lab / "static.c3d").out
