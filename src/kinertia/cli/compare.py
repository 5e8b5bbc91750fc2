"""Defines `kinertia compare`: what changed between sessions or conditions, and several results side by side."""

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Outcome, Overwrite, Quiet, results_folder
from kinertia.cli.terminal import out, shown_progress
from kinertia.estimation.result.fit import Fit
from kinertia.io.results.output_folder import complete_folder
from kinertia.io.subject.provenance import names_from_common_folder
from kinertia.report.comparison.change_tables import change_columns, curve_columns
from kinertia.report.comparison.side_by_side import (
    MOST_FITS,
    comparison_columns,
    comparison_summary,
    differences,
    outcome_of,
    remarks,
    render_comparison,
)
from kinertia.report.comparison.what_changed import Comparison, compared_sessions, fit_of
from kinertia.report.comparison.what_changed import compare as compare_sessions
from kinertia.report.exports.files import write_columns
from kinertia.report.pages.file_outputs import outputs_sentence


def compare(
    results: Annotated[
        list[Path],
        typer.Argument(help="Two sessions, or more results; one with --conditions."),
    ],
    conditions: Annotated[
        tuple[str, str] | None,
        typer.Option("--conditions", help="What changed from one condition to the other."),
    ] = None,
    norms: Annotated[
        Path | None, typer.Option(help="File of kinertia norms: compares Gait Profile Scores as well.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the page and table.")] = Path("comparison"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Compare sessions, conditions or methods: joint moments and angles, then body segment parameters.

    Two sessions, subject files or results: what changed (changes.csv, change_curves.csv).
    --conditions compares trials of one session, or chooses those of each.
    Two to six results: differences from the first (compare.html, compare.csv).

    [bold]Examples[/]

    kinertia compare before/subject.toml after/subject.toml -o comparison
    kinertia compare subject.toml --conditions normal "toe out"
    """
    if conditions is not None and len(results) == 1:
        return _compare_conditions(results[0], conditions, norms, output, overwrite)
    if conditions is not None and len(results) > 2:
        raise typer.BadParameter("with --conditions, give one session, or two")
    if not 2 <= len(results) <= MOST_FITS:
        raise typer.BadParameter(f"give 2 to {MOST_FITS} folders of results; these are {len(results)}")
    paths = [path.resolve() for path in results]
    if len(set(paths)) < len(paths):
        raise typer.BadParameter("one folder is named twice")
    results_folder(output, overwrite)
    names = names_from_common_folder(paths)
    with shown_progress() as progress:
        fits = {name: fit_of(path, progress) for name, path in zip(names, paths, strict=True)}
        found, reason = compared_sessions(list(fits.values()), conditions, progress, norms)
    page = render_comparison(fits, None if found is None else found.shown(), reason)
    with complete_folder(output, "compare") as work:
        (work / "compare.html").write_text(page, encoding="utf-8")
        write_columns(work / "compare.csv", comparison_columns(fits))
        if found is not None:
            _write_tables(work, found)
    if found is None:
        out.print(f"Joint moments and angles are not compared: {reason}.", soft_wrap=True)
    else:
        _print_changes(found)
    _print_bodies(fits)
    out.print(f"comparison in {output / 'compare.html'}", soft_wrap=True)
    summary = {"outcomes": []} if found is None else found.summary
    return Outcome({**summary, "not_compared": reason, **comparison_summary(fits)})


def _write_tables(folder: Path, found: Comparison) -> None:
    write_columns(folder / "changes.csv", change_columns((*found.steps, *found.outcomes)))
    write_columns(folder / "change_curves.csv", curve_columns(found.curves))


def _print_changes(found: Comparison) -> None:
    out.print(f"{found.before} -> {found.after}; internal moments over body mass", soft_wrap=True)
    for sentence in found.sentences:
        out.print(sentence, soft_wrap=True)


def _print_bodies(fits: dict[str, Fit]) -> None:
    (first_name, first), *others = fits.items()
    for sentence in remarks(fits):
        out.print(f"note: {sentence}")
    for name, fit in fits.items():
        if sentence := outputs_sentence(fit):
            out.print(f"{name}: {sentence}")
    out.print("Body segment parameters, which do not show whether joint moments changed:")
    for name, other in others:
        compared = differences(first, other)
        changed = [f"{one.parameter} of {one.segment}" for one in compared if one.changed]
        sentence = outcome_of(compared)
        if changed:
            sentence += f" ({', '.join(changed[:6])}{', ...' if changed[6:] else ''})"
        out.print(f"{name} against {first_name}: {sentence}")


def _compare_conditions(
    path: Path, conditions: tuple[str, str], norms: Path | None, output: Path, overwrite: bool
) -> Outcome:
    """Compare trials of two conditions in one estimate, which is made first if a subject file is given."""
    results_folder(output, overwrite)
    with shown_progress() as progress:
        found = compare_sessions(path, None, conditions, progress, norms)
    with complete_folder(output, "compare") as work:
        (work / "compare.html").write_text(found.page(), encoding="utf-8")
        _write_tables(work, found)
    _print_changes(found)
    out.print(f"all outcomes in {output / 'compare.html'}", soft_wrap=True)
    return Outcome(found.summary)
