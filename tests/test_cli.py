import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from importlib.metadata import version

import pytest
from rich.console import Console

from command_line import fitted, run
from kinertia import terminal
from walks import fit_arguments


def test_version_and_help():
    assert run("--version").out.strip() == version("kinertia")
    shown = run("fit", "--help")
    assert shown.status == 0
    for word in ("--static", "--forces", "--loads", "--mass", "--height", "--sex", "--markers", "--method", "-o"):
        assert word in shown.out


def test_installed_command():
    done = subprocess.run([sys.executable, "-c", "from kinertia.cli import main; main()", "fit", "no.toml"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 2
    assert re.fullmatch(r"error: .*no\.toml: no such file; .*\n", done.stderr)


def test_final_print_is_short_readable_and_says_what_was_used(fit_of):
    fit = fit_of("gait2354")
    lines = fit.outcome.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) < 70
    text = " ".join(fit.outcome.out.split())
    trial, mass = fit.trial, fit.summary["total_mass_kg"]
    assert "72.6 kg, 1.803 m, male; method simultaneous; marker set: Cleveland Clinic" in text
    assert f"{trial['n_dynamic_frames']} of {trial['n_frames']} frames" in text
    for unit, kind in (("N", "force"), ("Nm", "moment")):
        rms, top = trial[f"residual_{kind}_rms_{unit}"], trial[f"residual_{kind}_max_{unit}"]
        shown = " ".join(f"{rms[s]:.1f} ({top[s]:.1f})" for s in ("literature", "corrected", "estimate"))
        assert shown in text
    assert (
        f"measured {mass['measured']:.1f}, literature {mass['literature']:.1f}, estimate {mass['estimate']:.1f}" in text
    )
    assert "…" not in text
    for warning in fit.summary["warnings"]:
        assert f"warning: {warning}" in text
    for segment in ("pelvis", "torso", "thigh_r", "upper_arm_r"):
        assert re.search(rf"{segment} literature [\d.]+ -?\d+ ", text)


def test_progress_is_plain_lines_in_a_log(fit_of):
    assert fit_of("gait2354").outcome.err.splitlines() == ["reading", "calibration", "inverse kinematics", "estimate"]


def test_progress_is_a_bar_on_a_terminal(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal, "err", Console(file=screen, force_terminal=True, width=80))
    with terminal.shown_progress() as progress:
        progress("inverse kinematics", 0.5)
    assert "inverse kinematics" in screen.getvalue()
    assert "\r" in screen.getvalue()


@pytest.fixture
def person(tmp_path, shared_data):
    """A folder with the two C3D files of one person."""
    folder = tmp_path / "anna [b]"
    folder.mkdir()
    for kind in ("walk", "static"):
        shutil.copyfile(shared_data / "pig_c3d" / f"subject_a_{kind}.c3d", folder / f"{kind}.c3d")
    return folder


@pytest.mark.usefixtures("few_evaluations")
def test_init_then_fill_in_then_fit(person):
    """The drafted file says what is missing; with that filled in and a shorter window it runs as it is."""
    drafted = run("init", person)
    path = person / "subject.toml"
    assert drafted.status == 0
    assert f"wrote {path}" in drafted.out
    refusal = run("fit", path, "-o", person / "out")
    assert refusal.status == 2
    assert "[subject] lacks 'sex'" in refusal.err
    text = path.read_text()
    assert text.count("# sex = ") == 1
    text = re.sub(r'# sex = "\w+"', 'sex = "male"', text).replace("[[trial]]", "[[trial]]\nwindow_s = [2.8, 3.05]")
    path.write_text(text)
    fit = fitted(person / "out", path)
    assert fit.summary["subject"]["name"] == "anna [b]"
    assert fit.summary["subject"]["mass_kg"] == pytest.approx(41.5, abs=0.1)
    assert fit.trial["window_s"] == pytest.approx([2.8, 3.05])
    assert "anna [b]: 41.5 kg" in fit.outcome.out
    assert "walk: 2.800 to 3.050 s used" in " ".join(fit.outcome.out.split())


def test_init_leaves_an_existing_file_alone(person):
    (person / "subject.toml").write_text("mine")
    outcome = run("init", person)
    assert outcome.status == 2
    assert "exists already" in outcome.err
    assert (person / "subject.toml").read_text() == "mine"


def test_init_without_recordings(tmp_path):
    outcome = run("init", tmp_path)
    assert (outcome.status, outcome.err.count("\n")) == (2, 1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("few_evaluations")
def test_one_walk_as_two_trials(tmp_path, shared_data):
    walk, _, forces, _, loads, _, static, *_ = fit_arguments(shared_data, "gait2354")
    trial = f'[[trial]]\nmarkers = "{walk}"\nforces = "{forces}"\nloads = "{loads}"\n'
    (tmp_path / "subject.toml").write_text(
        f'[subject]\nsex = "male"\nmass_kg = 72.6\nheight_m = 1.803\n[model]\nstatic = "{static}"\n'
        f'{trial}name = "first"\nwindow_s = [0.3, 0.6]\n{trial}name = "second"\nwindow_s = [1.2, 1.5]\n'
    )
    fit = fitted(tmp_path / "out", tmp_path / "subject.toml", "--method", "two-level")
    assert [trial["name"] for trial in fit.summary["trials"]] == ["first", "second"]
    for trial, window in zip(fit.summary["trials"], ([0.3, 0.6], [1.2, 1.5]), strict=True):
        assert trial["window_s"] == pytest.approx(window, abs=1 / 60)
        residual = trial["residual_force_rms_N"]
        assert residual["estimate"] < residual["corrected"] < residual["literature"]
        assert (fit.folder / trial["name"] / "kinematics.mot").is_file()
    assert json.loads((fit.folder / "fit.json").read_text()) == fit.summary


def test_interruption_leaves_nothing(tmp_path, person):
    """As the shell's Ctrl-C does it: a signal in the middle of the work, once the first stage is told."""
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\nfrom kinertia.cli import main; main()"
    )
    files = [person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", "-o", tmp_path / "deep" / "out"]
    command = [sys.executable, "-c", code, "fit", *map(str, files)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while process.stderr.readline().strip() != "calibration":
            assert process.poll() is None
        os.kill(process.pid, signal.SIGINT)
        rest = process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in rest
    assert not (tmp_path / "deep").exists()


def test_trouble_with_the_disk_is_one_line(person, monkeypatch):
    def denied(*_):
        raise PermissionError(13, "Permission denied", "/somewhere")

    monkeypatch.setattr("kinertia.inputs.read_recording", denied)
    outcome = run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", "-o", person / "out")
    assert outcome.status == 2
    assert outcome.err.splitlines()[-1].startswith("error: /somewhere: Permission denied; check")
    assert not (person / "out").exists()
