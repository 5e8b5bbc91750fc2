"""What `kinertia fit` prints, its exit status, and where it writes."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from command_line import fitted, run
from kinertia.cli import common
from kinertia.cli.findings import report_tables
from kinertia.findings.finding import Severity, finding
from kinertia.findings.quantity import Quantity
from kinertia.report.exports.contents import summary
from synthetic_lab import synthetic_arguments


@pytest.mark.slow
def test_final_print_is_verdict_three_findings_and_where_the_results_are(fit_of):
    fit = fit_of("synthetic")
    first, *found, last = fit.outcome.out.splitlines()
    severities = [
        reported["severity"]
        for reported in fit.summary["findings"]
        if (reported["status"], reported["muted_by"]) == ("open", None)
    ]
    assert first.startswith(f"{fit.summary['verdict'].capitalize()}. ")
    assert first.endswith("the trial was used.")
    assert len([line for line in found if line.startswith(("ERROR", "WARNING", "CORRECTED"))]) <= 3
    assert all(not line.startswith("INFO") for line in found)
    assert f"{severities.count('INFO')} assumption" in " ".join(found)
    assert last == f"results in {fit.folder}"


MASSES = {"stated": "measured", "literature": "literature", "estimate": "estimate"}


def test_tables_are_short_readable_and_say_what_was_used(fit, two_level):
    for result in (fit, two_level):
        with common.out.capture() as captured:
            report_tables(result, summary(result))
        lines = captured.get().splitlines()
        assert max(len(line) for line in lines if not line.startswith("assumed: ")) <= 80
        assert len(lines) < 90
        text = " ".join(captured.get().split())
        told = summary(result)
        (trial,), mass = told["trials"], told["total_mass_kg"]
        assert f"72.6 kg, 1.803 m, male; method {result.settings.method}; marker set: Cleveland Clinic" in text
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


def test_a_fit_with_a_model_says_model_and_what_is_kept(fit):
    prior_sd, sd = fit.posterior.prior_sd.copy(), fit.posterior.sd.copy()
    prior_sd[-1] = sd[-1] = 0.0
    posterior = replace(fit.posterior, prior_sd=prior_sd, sd=sd)
    with common.out.capture() as captured:
        shown = replace(fit, posterior=posterior, file=SimpleNamespace(bsp=fit.estimate))
        report_tables(shown, summary(shown))
    shown = captured.get()
    assert "literature" not in shown.replace("from the literature", "")
    assert re.search(r"RMS \(max\), +model +corrected +estimate", shown)
    assert re.search(r"total mass \(kg\): stated 72\.6, model [\d.]+, estimate [\d.]+", shown)
    assert len(re.findall(r"^ +sd +fixed *$", shown, re.MULTILINE)) == 1


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
    sound = [reported for reported in short_fit.findings if reported.severity is not Severity.ERROR]
    fit.findings = (*sound, NOT_CONVERGED)
    return fit


def test_an_error_of_the_result_is_status_1_and_the_results_are_there(fit_at_once, tmp_path):
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 1
    assert outcome.out.startswith("Do not use. One error")
    assert "\nERROR  R201 " in outcome.out
    told = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert (told["converged"], told["verdict"]) == (False, "do not use")
    assert [reported["code"] for reported in told["findings"] if reported["severity"] == "ERROR"] == ["R201"]
    assert "INFO  " not in outcome.out
    loud = fit_at_once("-o", tmp_path / "out", "--verbose")
    assert "assumed: marker set: Plug-in Gait" in loud.out
    assert "early: seconds: read 0.2" in " ".join(loud.out.split())
    assert loud.out.count("INFO  ") > 0


def test_warnings_are_status_0(fit_at_once, tmp_path):
    fit_at_once.findings = (*fit_at_once.findings[:-1], NOT_CONVERGED.at(Severity.WARNING))
    outcome = fit_at_once("-o", tmp_path / "out")
    assert outcome.status == 0
    assert outcome.out.startswith("Use with care. ")


def test_quiet_fit_says_nothing(fit_at_once, tmp_path):
    outcome = fit_at_once("-o", tmp_path / "out", "--quiet")
    assert (outcome.status, outcome.out, outcome.err) == (1, "", "")
    assert (tmp_path / "out" / "fit.json").exists()
    refused = run("fit", tmp_path / "none.toml", "-q")
    assert (refused.status, refused.out) == (2, "")
    assert refused.err.startswith("error: ")


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
