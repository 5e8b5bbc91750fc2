"""Defines `kinertia plan` (what to record), `kinertia crossval` (BSPs on held-out trials) and `kinertia study ...`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from kinertia.cli.common import (
    Outcome,
    Output,
    Overwrite,
    Quiet,
    add_command,
    out,
    plain_table,
    results_folder,
    shown_progress,
)
from kinertia.io.subject.reader import read_subject
from kinertia.report.figures.plots import HOW, has_matplotlib
from kinertia.report.pages.study_pages import (
    CROSSVAL_HEADINGS,
    PLAN_CAPTION,
    PLAN_HEADINGS,
    crossval_rows,
    crossval_sentence,
    crossval_summary,
    plan_rows,
    plan_summary,
    save_crossval,
    save_plan,
    save_sensitivity,
    sensitivity_summary,
)
from kinertia.report.pages.table1 import HEADINGS as VARIANT_HEADINGS
from kinertia.report.pages.table1 import (
    save_table1,
    save_variants,
    table1_rows,
    table1_summary,
    variants_frame,
    variants_rows,
)
from kinertia.report.wording import start_of
from kinertia.studies.cross_validation import cross_validate
from kinertia.studies.plan import plan as plan_motions
from kinertia.studies.sensitivity import KINDS, run_sensitivity
from kinertia.studies.table1 import CONDITIONS, Table1, measured_trial, run_table1, study_trial
from kinertia.studies.table1_variants import run_variants
from kinertia.workflow.from_files import prepare_subject

study = typer.Typer(no_args_is_help=True, help="Studies on synthetic trials with known truth.")
Seed = Annotated[
    int, typer.Option(min=0, help="Seed of the random numbers; results do not depend on the number of processes.")
]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")]


def plan(
    subject: Annotated[
        Path | None,
        typer.Argument(help="Subject file (.toml) with the trials to choose from (default: the built-in motions)."),
    ] = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Predict the error bar of every BSP from candidate motions, to know what to record. Estimates nothing.

    [bold]Examples[/]

    kinertia plan -o out

    kinertia plan subject.toml -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        if subject is None:
            progress("predicting", 0.0)
            planned = plan_motions()
        else:
            wanted = read_subject(subject)
            planned = plan_motions(prepare_subject(wanted, progress), wanted.settings.cutoff_hz)
    save_plan(planned, output)
    table = plain_table(*PLAN_HEADINGS)
    for row in plan_rows(planned):
        table.add_row(*row)
    out.print(f"\n{PLAN_CAPTION}")
    out.print(table)
    out.print(f"results in {output}: plan.html, plan.csv (predicted sd of every parameter), plan.json", soft_wrap=True)
    return Outcome(plan_summary(planned))


def crossval(
    subject: Annotated[Path, typer.Argument(help="Subject file (.toml) with two or more trials.")],
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Hold out each trial in turn: do BSPs from the others explain it better than the literature's?

    [bold]Example[/]

    kinertia crossval subject.toml -o out
    """
    results_folder(output, overwrite)
    wanted = read_subject(subject)
    with shown_progress() as progress:
        ready = prepare_subject(wanted, progress)
        held_out = cross_validate(ready, wanted.settings.cutoff_hz, progress)
    before = start_of(ready).word
    save_crossval(held_out, before, output)
    table = plain_table(*(heading.replace(" (", "\n(") for heading in CROSSVAL_HEADINGS))
    last = ""
    for name, *row in crossval_rows(held_out, before):
        table.add_row("" if name == last else name, *row)
        last = name
    out.print(f"\nMotion and calibration estimated with frozen BSPs: the {before}'s, and those from the other trials.")
    out.print(table)
    out.print(crossval_sentence(held_out))
    out.print(f"results in {output}: crossval.html, crossval.json", soft_wrap=True)
    return Outcome(crossval_summary(held_out))


def table1(
    repeats: Annotated[int, typer.Option(min=1, help="Independent draws of start and noise.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same numbers.")] = 1,
    trial: Annotated[
        Path | None,
        typer.Option(help="Subject file of a measured trial to start from, or to have among the variants."),
    ] = None,
    variants: Annotated[
        bool,
        typer.Option(
            "--variants", help="Repeat the noisy conditions, changing one thing at a time (about 15 minutes)."
        ),
    ] = False,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Repeat the study: 49 parameters from starts with 50 % error, with and without noise and pelvis correction.

    [bold]Examples[/]

    kinertia study table1 -o out

    kinertia study table1 --repeats 3 --trial subject.toml -o out

    kinertia study table1 --variants --trial subject.toml -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        measured = None if trial is None else measured_trial(read_subject(trial), progress)
        if variants:
            walk = None if measured is None else measured[0]
            results = run_variants(walk, repeats=repeats, seed=seed, progress=lambda share: progress("variants", share))
        else:
            source, name = measured or (study_trial(), "synthetic walk")
            table = run_table1(source, repeats, seed, name, progress=lambda share: progress(f"{repeats} draws", share))
    if variants:
        save_variants(results, output)
        _report_variants(results, seed)
        _say_where(output, ("variants.html", "variants.md", "variants.csv"), "variants.png")
        return Outcome({"seed": seed, "draws": variants_frame(results).to_dict(orient="records")})
    save_table1(table, output)
    _report_table1(table, source.deviation)
    _say_where(output, ("report.html", "table1.json", "table1.csv"), "table1.png")
    return Outcome(table1_summary(table))


def _report_variants(results: Mapping[str, Table1], seed: int) -> None:
    out.print(f"\nseed {seed}. RMS error without / with correction, both with noise: mean over the draws.\n")
    # forces and torques are in the files: a terminal is not as wide
    wanted = [k for k, heading in enumerate(VARIANT_HEADINGS) if "pelvis" not in heading and "without" not in heading]
    shown = plain_table(*(VARIANT_HEADINGS[k] for k in wanted))
    for row in variants_rows(results):
        shown.add_row(*(row[k] for k in wanted))
    out.print(shown)


def _report_table1(table: Table1, deviation: np.ndarray) -> None:
    moved = f"{deviation[:3].max() * 1e3:.2g} mm and {np.degrees(deviation[3:]).max():.2g} degrees"
    out.print(
        f"\n{table.trial}; seed {table.seed}; {len(table.draws)} draws. The pelvis was moved by at most {moved} so "
        "that the root equations hold exactly. RMS / max error: mean over the draws, spread (standard deviation), and "
        "the published value.\n"
    )
    shown = plain_table("error", *(heading.replace(", ", ",\n") for heading in CONDITIONS.values()))
    for row in table1_rows(table):
        shown.add_row(*row)
    out.print(shown)
    stopped = {c: sum(not draw.converged[c] for draw in table.draws) for c in CONDITIONS}
    for condition, count in stopped.items():
        if count:
            out.print(
                f"{CONDITIONS[condition]}: {count} of {len(table.draws)} draws stopped at the limit of evaluations"
            )


def sensitivity(
    draws: Annotated[int, typer.Option(min=2, help="People in each condition.")] = 24,
    seed: Seed = 1,
    workers: Workers = None,
    output: Output = Path("out"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Study which BSPs are sensitive to noisy kinematics: errors against noise, strides and squats.

    [bold]Example[/]

    kinertia study sensitivity -o out
    """
    results_folder(output, overwrite)
    with shown_progress() as progress:
        result = run_sensitivity(draws, seed, workers, lambda share: progress("people", share))
    save_sensitivity(result, output)
    for kind, title in KINDS.items():
        listed = ", ".join(result.insensitive(kind)) or "none"
        out.print(f"small errors up to twice the amplitude of {title}: {listed}")
    out.print(f"shown by no condition: {', '.join(result.never()) or 'none'}")
    _say_where(output, ("sensitivity.html", "sensitivity.md", "sensitivity.json", "sensitivity.csv"), "sensitivity.png")
    return Outcome(sensitivity_summary(result))


def _say_where(output: Path, files: Sequence[str], picture: str) -> None:
    """List the files of the results, and how to get the picture if matplotlib is missing."""
    drawn = has_matplotlib()
    out.print(f"results in {output}: {', '.join([*files, picture] if drawn else files)}", soft_wrap=True)
    if not drawn:
        out.print(f"no {picture}: matplotlib is not installed: {HOW}", soft_wrap=True)


for command in (table1, sensitivity):
    add_command(study, command)
