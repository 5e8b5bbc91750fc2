import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from importlib.metadata import version
from types import SimpleNamespace

import pytest
from rich.console import Console

from command_line import fitted, run
from kinertia.cli import terminal
from kinertia.cli.fit_report import report_fit
from kinertia.diagnostics.result.verdict import CAUTION_FORCE_N, CAUTION_MOMENT_NM, PEAK_FORCE_SHARE, Verdict
from synthetic_lab import synthetic_arguments


def test_version_and_help():
    assert run("--version").out.strip() == version("kinertia")
    shown = run("fit", "--help")
    assert shown.status == 0
    for word in ("--static", "--forces", "--loads", "--mass", "--height", "--sex", "--markers", "--method", "-o"):
        assert word in shown.out


def test_help_reads_like_a_manual():
    shown = run("--help")
    text = " ".join(shown.out.split())
    assert max(map(len, shown.out.splitlines())) <= 80
    steps = [text.index(f"kinertia {command} ") for command in ("demo", "init", "check", "fit")]
    assert steps == sorted(steps)
    for status in (
        "0 done",
        "1 done, but a check failed",
        "2 an error in files or options, reported in one line",
        "70 Kinertia itself failed",
        "130 interrupted",
    ):
        assert status in text
    for limit in (*CAUTION_FORCE_N, *CAUTION_MOMENT_NM, 100 * PEAK_FORCE_SHARE):  # the manual says what the verdicts do
        assert f" {limit:g} " in text
    assert "no such option" in run("fit", "--nonsense").err.lower()


@pytest.mark.parametrize("command", ["demo", "init", "check", "fit", "study table1", "study accuracy"])
def test_every_command_has_an_example_and_every_example_can_be_parsed(command):
    shown = " ".join(run(*command.split(), "--help").out.split())
    assert re.search(rf"Examples? kinertia {command}", shown)
    known = {*run(*command.split(), "--help").out.split()}
    for option in re.findall(r"--\w+", shown.split("Example", 1)[1].split("╭", 1)[0]):
        assert option in known


@pytest.mark.slow
def test_installed_command():
    done = subprocess.run([sys.executable, "-c", "from kinertia.cli.app import main; main()", "fit", "no.toml"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 2
    assert re.fullmatch(r"error: .*no\.toml: no such file; .*\n", done.stderr)


@pytest.mark.slow
def test_final_print_is_short_readable_and_says_what_was_used(fit_of):
    fit = fit_of("synthetic")
    lines = fit.outcome.out.splitlines()
    assert max(len(line) for line in lines if not line.startswith("results in ")) <= 80
    assert len(lines) < 80
    text = " ".join(fit.outcome.out.split())
    trial, mass = fit.trial, fit.summary["total_mass_kg"]
    assert "72.6 kg, 1.803 m, male; method simultaneous; marker set: Cleveland Clinic" in text
    assert f"{trial['n_dynamic_frames']} of {trial['n_frames']} frames" in text
    for unit, kind in (("N", "force"), ("Nm", "moment")):
        rms, top = trial[f"residual_{kind}_rms_{unit}"], trial[f"residual_{kind}_max_{unit}"]
        shown = " ".join(f"{rms[s]:.1f} ({top[s]:.1f})" for s in ("literature", "corrected", "estimate"))
        assert shown in text
        rms, top = (trial[f"full_residual_{kind}_{size}_{unit}"]["estimate"] for size in ("rms", "max"))
        assert f" {rms:.1f} ({top:.1f}) {'N m' if unit == 'Nm' else 'N'}" in text.partition("full bandwidth")[2]
    assert f"{trial['cutoff_hz']:.3g} Hz {trial['cutoff_hz']:.3g} Hz {trial['motion_hz']:.3g} Hz" in text
    assert (
        f"stated {mass['measured']:.1f}, literature {mass['literature']:.1f}, estimate {mass['estimate']:.1f}" in text
    )
    assert "…" not in text
    for warning in fit.summary["warnings"]:
        assert f"warning: {warning}" in text
    for segment in ("pelvis", "torso", "thigh_r", "upper_arm_r"):
        assert re.search(rf"{segment} literature [\d.]+ -?\d+ ", text)


@pytest.mark.slow
def test_progress_is_plain_lines_in_a_log(fit_of):
    assert fit_of("synthetic").outcome.err.splitlines() == ["reading", "calibration", "inverse kinematics", "estimate"]


def test_progress_is_a_bar_on_a_terminal(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal.err, "console", Console(file=screen, force_terminal=True, width=80))
    with terminal.shown_progress() as progress:
        progress("inverse kinematics", 0.5)
    assert "inverse kinematics" in screen.getvalue()
    assert "\r" in screen.getvalue()


def test_progress_tells_the_time_left_of_the_stage(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal.err, "console", Console(file=screen, force_terminal=True, width=80))
    with terminal.shown_progress() as progress:
        progress("reading", 0.9)
        progress("estimate", 0.0)
        for share in (0.2, 0.4, 0.6):
            time.sleep(0.15)
            progress("estimate", share)
        time.sleep(0.15)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    assert re.search(r"estimate \S+ +0:00:0[01] 0:00:0[01] left", shown)
    assert not re.search(r"reading \S+ +\S+ +\S* ?left", shown)


@pytest.fixture
def person(tmp_path, c3d_lab):
    """A folder with the two C3D files of one person."""
    folder = tmp_path / "anna [b]"
    folder.mkdir()
    for kind in ("walk", "static"):
        shutil.copyfile(c3d_lab / f"{kind}.c3d", folder / f"{kind}.c3d")
    return folder


@pytest.mark.slow
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
    text = re.sub(r'# sex = "\w+"', 'sex = "male"', text).replace("[[trial]]", "[[trial]]\nwindow_s = [1.2, 1.45]")
    path.write_text(text)
    fit = fitted(person / "out", path)
    assert fit.summary["subject"]["name"] == "anna [b]"
    assert fit.summary["subject"]["mass_kg"] == pytest.approx(72.6, abs=0.1)
    assert fit.trial["window_s"] == pytest.approx([1.2, 1.45])
    assert "anna [b]: 72.6 kg" in fit.outcome.out
    assert "walk: 1.200 to 1.450 s used" in " ".join(fit.outcome.out.split())


@pytest.fixture
def fit_at_once(monkeypatch, short_fit, person):
    """`kinertia fit` with these options on a fit that is there already and did not converge; counts its runs."""
    done = []

    def run_fit(wanted, progress):
        done.append(1)
        return replace(short_fit, converged=False)

    monkeypatch.setattr("kinertia.cli.fit.fit_subject", run_fit)

    def fit(*options):
        return run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", *options)

    fit.runs = done
    return fit


def test_a_failed_check_is_status_1_and_the_results_are_there(fit_at_once, tmp_path):
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 1
    assert "fail: the estimate did not converge" in outcome.out
    assert json.loads((tmp_path / "out" / "fit.json").read_text())["converged"] is False
    assert "assumed: " not in outcome.out
    loud = fit_at_once("-o", tmp_path / "out", "--verbose")
    assert "assumed: marker set: Plug-in Gait" in loud.out
    assert "early: seconds: read 0.2" in " ".join(loud.out.split())
    assert loud.out.count("pass: ") > outcome.out.count("pass: ")


def test_no_failed_check_is_status_0(fit_at_once, tmp_path, monkeypatch):
    monkeypatch.setattr("kinertia.cli.fit.verdicts", lambda fit: [Verdict("caution", "so so"), Verdict("pass", "fine")])
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 0
    assert "caution: so so" in outcome.out
    assert "pass: 1 of 2 checks" in outcome.out


def test_a_fit_with_a_model_says_model_and_what_is_kept(fit):
    prior_sd, sd = fit.posterior.prior_sd.copy(), fit.posterior.sd.copy()
    prior_sd[-1] = sd[-1] = 0.0
    posterior = replace(fit.posterior, prior_sd=prior_sd, sd=sd)
    with terminal.out.capture() as captured:
        report_fit(replace(fit, posterior=posterior, file=SimpleNamespace(bsp=fit.estimate)))
    shown = captured.get()
    assert "literature" not in shown.replace("from the literature", "")
    assert re.search(r"RMS \(max\), +model +corrected +estimate", shown)
    assert re.search(r"total mass \(kg\): stated 72\.6, model [\d.]+, estimate [\d.]+", shown)
    assert len(re.findall(r"^ +sd +kept *$", shown, re.MULTILINE)) == 1


def test_quiet_fit_says_nothing(fit_at_once, tmp_path):
    outcome = fit_at_once("-o", tmp_path / "out", "--quiet")
    assert (outcome.status, outcome.out, outcome.err) == (1, "", "")
    assert (tmp_path / "out" / "fit.json").exists()
    refused = run("fit", tmp_path / "none.toml", "-q")
    assert (refused.status, refused.out) == (2, "")
    assert refused.err.startswith("error: ")


def test_quiet_progress(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(terminal.err, "console", Console(file=screen, force_terminal=True, width=80))
    monkeypatch.setattr(terminal.out, "quiet", True)
    with terminal.shown_progress() as progress:
        progress("reading", 0.9)
    assert screen.getvalue() == ""


@pytest.mark.slow
def test_results_never_go_among_somebody_elses_files_unasked(fit_at_once, tmp_path):
    """Refused before any work; with --force the others stay; its own results are replaced unasked."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.tex").write_text("mine")
    for command in (fit_at_once, lambda *options: run("demo", *options), lambda *o: run("study", "table1", *o)):
        refused = command("-o", out)
        assert refused.status == 2
        assert re.search(r"out: holds files that are not results of Kinertia \(thesis\.tex\); .* --force", refused.err)
        assert [path.name for path in out.iterdir()] == ["thesis.tex"]
    assert not fit_at_once.runs
    assert fit_at_once("-o", out, "--force").status == 1
    assert (out / "thesis.tex").read_text() == "mine"
    (out / "fit.json").write_text('{"kinertia": "an older one"}')
    assert fit_at_once("-o", out).status == 1
    assert "older" not in (out / "fit.json").read_text()


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


@pytest.mark.slow
@pytest.mark.usefixtures("few_evaluations")
def test_one_walk_as_two_trials(tmp_path, synthetic_lab):
    walk, _, forces, _, loads, _, static, *_ = synthetic_arguments(synthetic_lab)
    trial = f'[[trial]]\nmarkers = "{walk}"\nforces = "{forces}"\nloads = "{loads}"\n'
    (tmp_path / "subject.toml").write_text(
        f'[subject]\nsex = "male"\nmass_kg = 72.6\nheight_m = 1.803\n[model]\nstatic = "{static}"\n'
        f'{trial}name = "first"\nwindow_s = [1.2, 1.5]\n{trial}name = "second"\nwindow_s = [1.7, 2.0]\n'
    )
    fit = fitted(tmp_path / "out", tmp_path / "subject.toml", "--method", "two-level")
    assert [trial["name"] for trial in fit.summary["trials"]] == ["first", "second"]
    for trial, window in zip(fit.summary["trials"], ([1.2, 1.5], [1.7, 2.0]), strict=True):
        assert trial["window_s"] == pytest.approx(window, abs=1 / 100)
        residual = trial["residual_force_rms_N"]
        assert residual["estimate"] < residual["corrected"] < residual["literature"]
        assert (fit.folder / trial["name"] / "kinematics.mot").is_file()
    assert json.loads((fit.folder / "fit.json").read_text()) == fit.summary


@pytest.mark.parametrize(
    ("arguments", "stage"),
    [
        pytest.param(
            ["fit", "walk.c3d", "--static", "static.c3d", "--sex", "male"], "calibration", marks=pytest.mark.slow
        ),
        pytest.param(["demo"], "inverse kinematics", marks=pytest.mark.slow),
        pytest.param(["study", "table1", "--repeats", "1"], "1 draws", marks=pytest.mark.slow),
    ],
)
def test_interruption_leaves_nothing(tmp_path, person, arguments, stage):
    """As the shell's Ctrl-C does it: a signal in the middle of the work, once this stage is told."""
    signals = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{signals}\nfrom kinertia.cli.app import main; main()"
    files = [str(person / word) if word.endswith(".c3d") else word for word in arguments]
    command = [sys.executable, "-c", code, *files, "-o", str(tmp_path / "deep" / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while process.stderr.readline().strip() != stage:
            assert process.poll() is None
        os.kill(process.pid, signal.SIGINT)
        rest = process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in rest
    assert not (tmp_path / "deep").exists()
    assert [path.name for path in tmp_path.iterdir()] == [person.name]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no signals")
@pytest.mark.parametrize("name", ["SIGTERM", pytest.param("SIGHUP", marks=pytest.mark.slow)])
def test_the_request_to_end_leaves_nothing(tmp_path, person, name):
    code = """
        import contextlib, os, signal, sys
        from kinertia.cli.app import main
        from kinertia.report import check_page
        name, made = sys.argv.pop(), check_page.complete_folder
        signal.signal(getattr(signal, name), signal.SIG_DFL)  # nohup ignores it
        @contextlib.contextmanager
        def ended(*arguments):
            with made(*arguments) as work:
                os.kill(os.getpid(), getattr(signal, name))
                yield work
        check_page.complete_folder = ended
        main()
    """
    command = [sys.executable, "-c", textwrap.dedent(code), "check", person / "walk.c3d", "-o", tmp_path / "out", name]
    done = subprocess.run(list(map(str, command)), capture_output=True, check=False)
    assert done.returncode == 128 + getattr(signal, name), done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [person.name]


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
    assert line.startswith("error: Kinertia failed, which it should not on any input (ZeroDivisionError: division by")
    assert str(log) in line
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


def test_trouble_with_the_disk_is_one_line(person, monkeypatch):
    def denied(*_, **__):
        raise PermissionError(13, "Permission denied", "/somewhere")

    monkeypatch.setattr("kinertia.workflow.from_files.read_recording", denied)
    outcome = run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", "-o", person / "out")
    assert outcome.status == 2
    assert outcome.err.splitlines()[-1].startswith("error: /somewhere: Permission denied; check")
    assert not (person / "out").exists()
