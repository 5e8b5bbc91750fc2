"""Defines `kinertia compare`: shows several finished fits side by side."""

from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Overwrite, Quiet, results_folder
from kinertia.cli.outcome import Outcome
from kinertia.cli.terminal import out
from kinertia.io.output_folder import complete_folder
from kinertia.io.provenance import names_from_common_folder
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


def compare(
    results: Annotated[list[Path], typer.Argument(help="Two or more folders written by kinertia fit.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the page and table.")] = Path("comparison"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Compare fits: differences beyond their error bars between sessions of one person, methods or models.

    The others are compared with the first. Writes compare.html and
    compare.csv.

    [bold]Example[/]

    kinertia compare before/out after/out -o comparison
    """
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
    for name, other in others:
        compared = differences(first, other)
        changed = [f"{one.parameter} of {one.segment}" for one in compared if one.changed]
        sentence = outcome_of(compared)
        if changed:
            sentence += f" ({', '.join(changed[:6])}{', ...' if changed[6:] else ''})"
        out.print(f"{name} against {first_name}: {sentence}")
    out.print(f"comparison in {output / 'compare.html'}", soft_wrap=True)
    return Outcome(comparison_summary(fits))
