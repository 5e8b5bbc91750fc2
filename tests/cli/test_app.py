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
from kinertia.cli.fit_report import report_tables
from kinertia.cli.renamed_options import as_named_now
from kinertia.diagnostics.result.residuals import FORCE, MOMENT, PEAK_FORCE_SHARE
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.io.provenance import command_line
from kinertia.report.files import summary
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
        "1 done, but an ERROR was found",
        "2 nothing could be computed: errors in files or options, one line each",
        "70 Kinertia itself failed",
        "130 interrupted",
    ):
        assert status in text
    # the manual says what the rules do
    for limit in (*FORCE.acceptable, *MOMENT.acceptable, 100 * PEAK_FORCE_SHARE):
        assert f" {limit:g} " in text
    assert "no such option" in run("fit", "--nonsense").err.lower()


@pytest.mark.parametrize("command", ["demo", "init", "check", "fit", "study table1", "study sensitivity"])
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
    assert re.fullmatch(r"error: .*no\.toml: F101 .*\n", done.stderr)


@pytest.mark.slow
def test_final_print_is_verdict_three_findings_and_where_the_results_are(fit_of):
    fit = fit_of("synthetic")
    first, *found, last = fit.outcome.out.splitlines()
    severities = [
        one["severity"] for one in fit.summary["findings"] if (one["status"], one["muted_by"]) == ("open", None)
    ]
    assert first.startswith(f"{fit.summary['verdict']}: ")
    assert f"{fit.summary['rules_run']} rules, 1 of 1 trials" in first
    assert len([line for line in found if line.startswith(("ERROR", "WARNING", "CORRECTED"))]) <= 3
    assert all(not line.startswith("INFO") for line in found)
    assert f"{severities.count('INFO')} assumption" in " ".join(found)
    assert last == f"results in {fit.folder}"


def test_tables_are_short_readable_and_say_what_was_used(fit, two_level):
    for one in (fit, two_level):
        with terminal.out.capture() as captured:
            report_tables(one)
        lines = captured.get().splitlines()
        assert max(len(line) for line in lines if not line.startswith("assumed: ")) <= 80
        assert len(lines) < 90
        text = " ".join(captured.get().split())
        told = summary(one)
        (trial,), mass = told["trials"], told["total_mass_kg"]
        assert f"72.6 kg, 1.803 m, male; method {one.settings.method}; marker set: Cleveland Clinic" in text
        assert f"{trial['n_dynamic_frames']} of {trial['n_frames']} frames" in text
        for unit, kind in (("N", "force"), ("Nm", "moment")):
            rms, top = trial[f"residual_{kind}_rms_{unit}"], trial[f"residual_{kind}_max_{unit}"]
            assert " ".join(f"{rms[s]:.1f} ({top[s]:.1f})" for s in ("literature", "corrected", "estimate")) in text
            rms, top = (trial[f"full_residual_{kind}_{size}_{unit}"]["estimate"] for size in ("rms", "max"))
            assert f" {rms:.1f} ({top:.1f}) {'N m' if unit == 'Nm' else 'N'}" in text.partition("full bandwidth")[2]
        assert f"{trial['cutoff_hz']:.3g} Hz {trial['cutoff_hz']:.3g} Hz {trial['motion_hz']:.3g} Hz" in text
        shown = [f"{name} {mass[source]:.1f}" for name, source in MASSES.items()]
        assert ", ".join(shown) in text
        assert "…" not in text
        for segment in ("pelvis", "torso", "thigh_r", "upper_arm_r"):
            assert re.search(rf"{segment} literature [\d.]+ -?\d+ ", text)


MASSES = {"stated": "measured", "literature": "literature", "estimate": "estimate"}


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
    assert re.search(r"subject\.toml, line \d+: F191 .*\[subject\] lacks 'sex'", refusal.err)
    text = path.read_text()
    assert text.count("# sex = ") == 1
    text = re.sub(r'# sex = "\w+"', 'sex = "male"', text).replace("[[trial]]", "[[trial]]\nwindow_s = [1.2, 1.45]")
    path.write_text(text)
    fit = fitted(person / "out", path)
    assert fit.summary["subject"]["name"] == "anna [b]"
    assert fit.summary["subject"]["mass_kg"] == pytest.approx(72.6, abs=0.1)
    assert fit.trial["window_s"] == pytest.approx([1.2, 1.45])
    assert f"results in {fit.folder}" in fit.outcome.out


NOT_CONVERGED = finding("R201", iterations=Quantity(30, "1"))


@pytest.fixture
def fit_at_once(monkeypatch, short_fit, person):
    """`kinertia fit` with these options on a fit that is there already and did not converge; counts its runs."""
    done = []

    def run_fit(wanted, progress, overrule):
        done.append(1)
        return replace(short_fit, converged=False, findings=fit.findings)

    monkeypatch.setattr("kinertia.cli.fit.fit_subject", run_fit)

    def fit(*options):
        return run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", *options)

    fit.runs = done
    sound = [one for one in short_fit.findings if one.severity is not Severity.ERROR]
    fit.findings = (*sound, NOT_CONVERGED)
    return fit


def test_an_error_of_the_result_is_status_1_and_the_results_are_there(fit_at_once, tmp_path):
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 1
    assert outcome.out.startswith("do not use: 1 error; ")
    assert "\nERROR  R201 " in outcome.out
    told = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert (told["converged"], told["verdict"]) == (False, "do not use")
    assert [one["code"] for one in told["findings"] if one["severity"] == "ERROR"] == ["R201"]
    assert "INFO  " not in outcome.out
    loud = fit_at_once("-o", tmp_path / "out", "--verbose")
    assert "assumed: marker set: Plug-in Gait" in loud.out
    assert "early: seconds: read 0.2" in " ".join(loud.out.split())
    assert loud.out.count("INFO  ") > 0


def test_warnings_are_status_0(fit_at_once, tmp_path):
    fit_at_once.findings = (*fit_at_once.findings[:-1], NOT_CONVERGED.at(Severity.WARNING))
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 0
    assert outcome.out.startswith("use with care: ")


def test_a_fit_with_a_model_says_model_and_what_is_kept(fit):
    prior_sd, sd = fit.posterior.prior_sd.copy(), fit.posterior.sd.copy()
    prior_sd[-1] = sd[-1] = 0.0
    posterior = replace(fit.posterior, prior_sd=prior_sd, sd=sd)
    with terminal.out.capture() as captured:
        report_tables(replace(fit, posterior=posterior, file=SimpleNamespace(bsp=fit.estimate)))
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


def test_options_of_before_still_work_and_say_their_names_of_now(tmp_path):
    """In the place of the option that they are called now; with no others is there a notice."""
    (tmp_path / "thesis.tex").write_text("mine")
    old = run("check", tmp_path / "none.trc", "-o", tmp_path, "--force")
    now = run("check", tmp_path / "none.trc", "-o", tmp_path, "--overwrite")
    assert (old.status, now.status) == (2, 2)
    assert "--overwrite" in old.err
    assert "none.trc" in old.err
    assert "none.trc" in now.err
    assert "--overwrite" not in now.err
    assert as_named_now(["fit", "--loads", "x.xml", "--force"]) == ["fit", "--loads", "x.xml", "--overwrite"]


def test_help_begins_with_what_a_laboratory_needs_first():
    """The rest stands below, under a heading of its own."""
    shown = run("--help").out
    first = ("demo", "app", "init", "check", "fit", "compare", "export", "cohort", "explain")
    places = [shown.index(f"│ {name} ") for name in first]
    assert places == sorted(places)
    assert places[-1] < shown.index("─ More ─") < shown.index("│ markers ")


@pytest.mark.slow
def test_results_never_go_among_somebody_elses_files_unasked(fit_at_once, tmp_path):
    """Refused before any work; with --overwrite the others stay; its own results are replaced unasked."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.tex").write_text("mine")
    for command in (fit_at_once, lambda *options: run("demo", *options), lambda *o: run("study", "table1", *o)):
        refused = command("-o", out)
        assert refused.status == 2
        assert re.search(
            r"out: holds files that are not results of Kinertia \(thesis\.tex\); .* --overwrite", refused.err
        )
        assert [path.name for path in out.iterdir()] == ["thesis.tex"]
    assert not fit_at_once.runs
    assert fit_at_once("-o", out, "--overwrite").status == 1
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


def test_commands_of_a_folder_with_a_space_can_be_typed_as_shown(tmp_path, c3d_lab):
    folder = tmp_path / "Anna Müller"
    folder.mkdir()
    shutil.copyfile(c3d_lab / "static.c3d", folder / "static.c3d")
    shutil.copyfile(c3d_lab / "walk.c3d", folder / "walk.c3d")
    drafted = run("init", folder)
    assert command_line(["kinertia", "check", str(folder / "subject.toml")]) in drafted.out
    assert command_line(["kinertia", "init", str(folder)]) in run("init", folder, "--measures").out


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

    monkeypatch.setattr("kinertia.io.person_recordings.read_recording", denied)
    outcome = run("fit", person / "walk.c3d", "--static", person / "static.c3d", "--sex", "male", "-o", person / "out")
    assert outcome.status == 2
    assert outcome.err.splitlines()[-1].startswith("error: /somewhere: Permission denied; check")
    assert not (person / "out").exists()
