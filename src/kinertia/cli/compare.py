"""Defines `kinertia compare`: shows several finished fits side by side."""

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out, shown_progress
from kinertia.estimation.condition_changes import changes
from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import names_from_common_folder
from kinertia.report.changes import change_columns, change_sentences, changed_sentence, changes_summary
from kinertia.report.comparison import (
    MOST_FITS,
    comparison_columns,
    comparison_summary,
    differences,
    outcome_of,
    remarks,
    render_comparison,
)
from kinertia.report.file_outputs import outputs_sentence
from kinertia.report.files import write_columns
from kinertia.report.saved_fit import load_fit
from kinertia.workflow.from_files import fit_subject


def compare(
    results: Annotated[
        list[Path],
        typer.Argument(help="Two or more folders written by kinertia fit; with --conditions, one, or a subject file."),
    ],
    conditions: Annotated[
        tuple[str, str] | None,
        typer.Option("--conditions", help="What changed from one condition to the other."),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the page and table.")] = Path("comparison"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Compare fits: differences beyond their error bars between sessions of one person, methods or models.

    The others are compared with the first: compare.html, compare.csv.
    --conditions compares joint moments and angles of one session's trials,
    by their condition in the subject file: changes.csv.

    [bold]Examples[/]

    kinertia compare before/out after/out -o comparison
    kinertia compare subject.toml --conditions normal "toe out"
    """
    if conditions is not None:
        return _compare_conditions(results, conditions, output, overwrite)
    if not 2 <= len(results) <= MOST_FITS:
        raise typer.BadParameter(f"give 2 to {MOST_FITS} folders of results; these are {len(results)}")
    paths = [path.resolve() for path in results]
    if len(set(paths)) < len(paths):
        raise typer.BadParameter("one folder is named twice")
    results_folder(output, overwrite)
    fits = {name: load_fit(path) for name, path in zip(names_from_common_folder(paths), paths, strict=True)}
    with complete_folder(output, "compare") as work:
        (work / "compare.html").write_text(render_comparison(fits), encoding="utf-8")
        write_columns(work / "compare.csv", comparison_columns(fits))
    (first_name, first), *others = fits.items()
    for sentence in remarks(fits):
        out.print(f"note: {sentence}")
    for name, fit in fits.items():
        if sentence := outputs_sentence(fit):
            out.print(f"{name}: {sentence}")
    out.print("Body segment parameters; joint moments and angles are compared by --conditions, within one session.")
    for name, other in others:
        compared = differences(first, other)
        changed = [f"{one.parameter} of {one.segment}" for one in compared if one.changed]
        sentence = outcome_of(compared)
        if changed:
            sentence += f" ({', '.join(changed[:6])}{', ...' if changed[6:] else ''})"
        out.print(f"{name} against {first_name}: {sentence}")
    out.print(f"comparison in {output / 'compare.html'}", soft_wrap=True)
    return Outcome(comparison_summary(fits))


def _compare_conditions(results: list[Path], conditions: tuple[str, str], output: Path, overwrite: bool) -> Outcome:
    """Compare trials of two conditions in one estimate, which is made first if a subject file is given."""
    if len(results) != 1:
        raise typer.BadParameter("with --conditions, give one folder of results, or one subject file")
    results_folder(output, overwrite)
    with shown_progress() as progress:
        fit = load_fit(results[0]) if results[0].is_dir() else fit_subject(results[0], progress)
        found = changes(fit, *conditions, lambda share: progress("comparison", share))
    with complete_folder(output, "compare") as work:
        write_columns(work / "changes.csv", change_columns(found))
    out.print(f"{conditions[0]} -> {conditions[1]}; internal moments over body mass", soft_wrap=True)
    for sentence in (*change_sentences(found), changed_sentence(found)):
        out.print(sentence, soft_wrap=True)
    out.print(f"all outcomes in {output / 'changes.csv'}", soft_wrap=True)
    return Outcome(changes_summary(*conditions, found))
