"""Defines `kinertia plan` (what to record) and `kinertia crossval` (do the BSPs explain held-out trials?)."""

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Outcome, Output, Overwrite, Quiet, results_folder
from kinertia.cli.terminal import out, plain_table, shown_progress
from kinertia.io.subject.reader import read_subject
from kinertia.report.pages.plan_page import (
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
)
from kinertia.report.wording import start_of
from kinertia.studies.cross_validation import cross_validate
from kinertia.studies.plan import plan as plan_motions
from kinertia.workflow.from_files import prepare_subject


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
