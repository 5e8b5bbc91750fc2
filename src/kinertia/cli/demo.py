"""Defines `kinertia demo`: fits a synthetic person of known truth, or a measured walk that is downloaded."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from kinertia.cli.findings_view import show_overview
from kinertia.cli.fit_report import show_coverage
from kinertia.cli.measured_demo import run_measured_demo
from kinertia.cli.options import Output, Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.synthetic_demo import Demo, run_demo
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.io.subject.provenance import command_line
from kinertia.report.files import summary

Method = Literal["simultaneous", "two-level"]
_SHOWN_JOINTS = ("hip flexion", "hip adduction", "knee", "ankle", "lumbar extension")
"""Joints on the terminal; `report.html` has all."""


def demo(
    measured: Annotated[
        bool, typer.Option("--measured", help="Fit a measured walk instead (downloaded once).")
    ] = False,
    method: Annotated[Method, typer.Option(help="Estimator.")] = "simultaneous",
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Show what Kinertia does; needs no files.

    A synthetic person walks through a synthetic laboratory whose instruments have
    errors; Kinertia then estimates from its files and compares the estimate with
    the truth. With --method two-level, it does so by the study's estimator.

    With --measured, Kinertia fits a recorded walk: OpenSim's gait2354 example,
    downloaded once (0.9 MB; first run pip install ".\\[samples]"). Results,
    report and exit status are those of kinertia fit.

    [bold]Examples[/]

    kinertia demo -o out

    kinertia demo --measured -o out
    """
    results_folder(output, overwrite)
    if measured:
        if method != "simultaneous":
            raise typer.BadParameter("is for the synthetic person; leave out --measured", param_hint="'--method'")
        return _measured_demo(output)
    with shown_progress() as progress:
        result = run_demo(output, progress=progress, method=method)
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
    show_coverage(fit)
    lab = folder / "lab"
    check = command_line(["kinertia", "check", str(lab / "subject.toml")])
    out.print(
        f"results in {folder}, the laboratory's files in {lab}\nto see what the files are like: {check}",
        soft_wrap=True,
    )
    return Outcome({"folder": str(folder), **summary(fit)}, int(fit.overview.failed))


def _against_truth(result: Demo) -> dict[str, Any]:
    """Return RMS errors of the parameters by estimate, and per joint of the moments (N m), with their intervals."""
    names = ("mass_kg", "com_m", "inertia_kgm2")
    bodies = {"literature": result.fit.literature, "estimate": result.fit.estimate}
    intervals = result.moment_intervals
    return {
        "rms_errors": {name: dict(zip(names, result.rms_errors(body), strict=True)) for name, body in bodies.items()},
        "moment_rms_errors_Nm": {
            joint: dict(zip(("usual_pipeline", "estimate"), pair, strict=True))
            for joint, pair in result.moment_errors.items()
        },
        "moment_intervals": {
            joint: dict(zip(("half_width_Nm", "share_with_truth"), pair, strict=True))
            for joint, pair in intervals.items()
        },
    }


def _report_demo(result: Demo, folder: Path) -> None:
    out.print(
        "A synthetic person (72.6 kg, 1.803 m) unlike the body tables, measured with 4-18 mm of skin motion. "
        "Kinertia read the files; only this comparison knows the truth."
    )
    out.print(_moment_table(result))
    out.print(_faults(result))
    show_overview(result.fit.overview, verbose=False)
    before, after = (result.rms_errors(body) for body in (result.fit.literature, result.fit.estimate))
    out.print(
        "\nThe body, RMS error against the truth, tables -> estimate: "
        f"mass {before[0]:.2f} -> {after[0]:.2f} kg, centres of mass {before[1] * 1e3:.0f} -> {after[1] * 1e3:.0f} mm, "
        f"moments of inertia {before[2]:.4f} -> {after[2]:.4f} kg m2"
    )
    if result.fit.posterior is None:
        out.print(_two_level_verdict(before, after))
    out.print(f"\nreport: {folder / 'report.html'}; files: {folder / 'lab'}", soft_wrap=True)
    out.print("your own: kinertia init FOLDER; kinertia fit FOLDER/subject.toml -o out", soft_wrap=True)


def _moment_table(result: Demo) -> Any:
    intervals = result.moment_intervals
    bars = ("95 % interval", "truth inside") if intervals else ()
    table = plain_table("joint moments against the truth", "IK + ID", "Kinertia", *bars)
    for joint in _SHOWN_JOINTS:
        off = [f"{value:.1f} N m" for value in result.moment_errors[joint]]
        if intervals:
            half, inside = intervals[joint]
            off += [f"+- {half:.1f} N m", f"{100 * inside:.0f} %"]
        table.add_row(joint, *off)
    return table


def _faults(result: Demo) -> str:
    """Return what the laboratory did wrong, by the numbers of this run."""
    noise = result.noise
    faults = [
        f"plate 2 read {100 * noise.gain:.0f} % too much" if noise.gain else "",
        f"forces lagged by {1e3 * noise.delay_s:.0f} ms" if noise.delay_s else "",
    ]
    known = " and ".join(filter(None, faults)) or "nothing but noise"
    if result.fit.posterior is None:
        return f"The laboratory's errors: {known}. Two-level corrects no instruments."
    return f"The laboratory's errors: {known}. Kinertia reports:"


def _two_level_verdict(before: tuple[float, float, float], after: tuple[float, float, float]) -> str:
    """Compare two-level's RMS errors with the tables' in a sentence, by the numbers of this run."""
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
