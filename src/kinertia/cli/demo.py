"""Defines `kinertia demo`: fits a synthetic person of known truth, or a measured walk that is downloaded."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.cli.findings_view import show_overview
from kinertia.cli.measured_demo import run_measured_demo
from kinertia.cli.options import Output, Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.synthetic_demo import Demo, run_demo
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.io.provenance import command_line
from kinertia.report.files import summary
from kinertia.trial.rms import rms_length


def demo(
    measured: Annotated[
        bool, typer.Option("--measured", help="Fit a measured walk instead (downloaded once).")
    ] = False,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Show what Kinertia does; needs no files.

    A synthetic person walks through a synthetic laboratory; Kinertia then estimates from its files and compares the
    estimate with the truth.

    With --measured, Kinertia fits a recorded walk: OpenSim's gait2354 example,
    downloaded once (0.9 MB; first run pip install ".\\[samples]"). Results,
    report and exit status are those of kinertia fit.

    [bold]Examples[/]

    kinertia demo -o out

    kinertia demo --measured -o out
    """
    results_folder(output, overwrite)
    if measured:
        return _measured_demo(output)
    with shown_progress() as progress:
        result = run_demo(output, progress=progress)
    _report_demo(result, output)
    return Outcome({"folder": str(output), **summary(result.fit), "truth": _against_truth(result)})


def _measured_demo(folder: Path) -> Outcome:
    with shown_progress() as progress:
        fit = run_measured_demo(folder, progress)
    out.print(
        "\nA measured walk, whose truth is unknown: OpenSim's gait2354 example, a man walking over force "
        "plates, from https://github.com/opensim-org/opensim-models (Apache License 2.0)."
    )
    show_overview(fit.overview, verbose=False)
    lab = folder / "lab"
    check = command_line(["kinertia", "check", str(lab / "subject.toml")])
    out.print(
        f"results in {folder}, the laboratory's files in {lab}\nto see what the files are like: {check}",
        soft_wrap=True,
    )
    return Outcome({"folder": str(folder), **summary(fit)}, int(fit.overview.failed))


def _against_truth(result: Demo) -> dict[str, Any]:
    """Return RMS errors of the parameters by estimate, and of the joint moments (N m) by joint."""
    names = ("mass_kg", "com_m", "inertia_kgm2")
    bodies = {"literature": result.fit.literature, "estimate": result.fit.estimate}
    bodies["two_level"] = result.two_level.estimate
    return {
        "rms_errors": {name: dict(zip(names, result.rms_errors(body), strict=True)) for name, body in bodies.items()},
        "moment_rms_errors_Nm": {
            joint: dict(zip(("usual_pipeline", "estimate"), pair, strict=True))
            for joint, pair in result.moment_errors.items()
        },
    }


def _report_demo(result: Demo, folder: Path) -> None:
    fit = result.fit
    bodies = {
        "truth": result.truth,
        "literature": fit.literature,
        "estimate": fit.estimate,
        "two-level": result.two_level.estimate,
    }
    trial = fit.trials[0]
    out.print(
        "\nA synthetic person (72.6 kg, 1.803 m) whose body differs from the literature by 10 % in masses, 10 mm in "
        "centres of mass and 10 % in moments of inertia (standard deviations) walked over two force plates. Measured "
        "with: skin motion that follows the joints (10-18 mm on the thigh, 7-17 mm on the shank, 4-9 mm elsewhere), "
        f"cameras 0.5 mm, plates 1 N. {len(trial.time)} frames with all ground contact on the plates were used.\n"
    )
    table = plain_table("segment", "", "mass\n(kg)", "CoM off by\n(mm)", "Ixx\n(kg m2)", "Iyy", "Izz")
    for i, segment in enumerate(result.truth.segments):
        if segment.endswith("_l"):
            continue
        name = segment.removesuffix("_r")
        for source, bsp in bodies.items():
            off = np.linalg.norm(bsp.com_m[i] - result.truth.com_m[i])
            moments = (f"{value:.4f}" for value in bsp.inertia_kgm2[i].diagonal())
            gap = "-" if source == "truth" else f"{off * 1e3:.0f}"
            table.add_row(name, source, f"{bsp.mass_kg[i]:.2f}", gap, *moments)
            name = ""
    out.print(table)
    joints = plain_table("joint moments, RMS error against the truth (N m)", "usual pipeline", "estimate")
    for joint, pair in result.moment_errors.items():
        joints.add_row(joint, *(f"{value:.2f}" for value in pair))
    out.print(joints)
    out.print("usual pipeline: measured motion, literature BSPs, forces as measured\n")
    sources = list(bodies)[1:]
    errors = plain_table("RMS error against the truth", "", *sources)
    rms_errors = [result.rms_errors(bodies[source]) for source in sources]
    named = (
        ("mass", "kg", ".2f", 1.0),
        ("centre of mass", "mm", ".0f", 1e3),
        ("moments of inertia", "kg m2", ".4f", 1.0),
    )
    for k, (what, unit, form, factor) in enumerate(named):
        errors.add_row(what, unit, *(f"{values[k] * factor:{form}}" for values in rms_errors))
    out.print(errors)
    loads = {**trial.residuals, "two-level": result.two_level.trials[0].residuals["estimate"]}
    out.print(
        "residual at the pelvis, RMS: "
        + "; ".join(
            f"{stage} {rms_length(load[:, :3]):.1f} N, {rms_length(load[:, 3:]):.1f} N m"
            for stage, load in loads.items()
        )
        + "\n"
    )
    out.print(_verdict(rms_errors[0], rms_errors[1]) + "\n")
    out.print(_two_level_verdict(rms_errors[0], rms_errors[2]) + "\n")
    show_overview(fit.overview, verbose=False)
    out.print(
        f"results in {folder}, the laboratory's files in {folder / 'lab'}, truth against estimate in "
        f"{folder / 'bsp_truth.csv'}\n"
        f"next, with your own files: kinertia init FOLDER, then kinertia fit FOLDER/subject.toml -o out"
    )


def _verdict(before: tuple[float, float, float], after: tuple[float, float, float]) -> str:
    """Compare the estimate with the literature in a sentence, by the numbers of this run."""
    shares = ", ".join(
        f"{what} {100 * (other / one - 1):+.0f} %"
        for what, one, other in zip(("mass", "centre of mass", "inertia"), before, after, strict=True)
    )
    return (
        f"The simultaneous estimate changes the literature's errors by: {shares}. It weighs "
        "the literature against the data, corrects the whole motion, and is always physically possible; bsp.csv "
        "shows how much of each parameter was measured."
    )


def _two_level_verdict(before: tuple[float, float, float], after: tuple[float, float, float]) -> str:
    """Compare the estimate with two-level in a sentence, by the numbers of this run."""
    worse = sum(one < other for one, other in zip(before, after, strict=True))
    if worse == len(before):
        finding = "Two-level explains the forces far better, yet every class of parameters is further from the truth"
    elif worse:
        finding = f"Two-level explains the forces far better, yet {worse} of 3 classes of parameters are further off"
    else:
        return (
            "Two-level is nearer to the truth than the literature in this run. With skin motion that is luck "
            "rather than the rule: see docs/validation/study.md."
        )
    return (
        f"{finding} than the literature: with skin motion, small residuals do not prove the parameters right. "
        "The study that two-level comes from found the same (docs/validation/study.md); without noise two-level "
        "finds them exactly (kinertia study table1)."
    )
