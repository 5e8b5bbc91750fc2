"""Defines `kinertia norms`: normative bands of a laboratory from the fits of its controls."""

import csv
import io
from pathlib import Path
from typing import Annotated

import typer

from kinertia.cli.options import Quiet, own_file
from kinertia.cli.outcome import Outcome
from kinertia.cli.results_of_people import results_of_people
from kinertia.cli.terminal import out, shown_progress
from kinertia.errors import FileError, KinertiaError
from kinertia.estimation.normative_bands import Control, band_columns, mixture
from kinertia.estimation.result import Fit
from kinertia.io.norms_file import read_norms
from kinertia.io.results.output_folder import write_then_rename
from kinertia.io.text.csv_file import inert
from kinertia.report.exports.saved_fit import read_saved


def norms(
    results: Annotated[
        list[Path],
        typer.Argument(help="Folders of kinertia fit, one per control; a cohort; or folders of such folders."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write.")] = Path("norms.csv"),
    quiet: Quiet = False,
) -> Outcome:
    """Make your laboratory's normative bands from the fits of people without pathology.

    Mean and SD between people at every percent of the gait cycle; each person
    counts once. kinertia report draws the bands and adds the Gait Profile Score.

    [bold]Examples[/]

    kinertia norms controls/anna controls/ben controls/cleo -o norms.csv

    kinertia report out --norms norms.csv
    """
    own_file(output, read_norms, "kinertia norms")
    people: dict[str, Control] = {}
    seen: set[str] = set()
    folders = results_of_people(results)
    with shown_progress() as progress:
        for k, found in enumerate(folders):
            progress("reading", k / len(folders))
            saved = read_saved(found.folder)
            fit, name = saved.fit, found.name or _name(saved.fit, found.folder)
            files = set() if saved.provenance is None else set(saved.provenance.files.values())
            if name in people or files & seen:
                raise FileError(found.folder, f"is a second fit of {name}: give one folder per person")
            seen |= files
            try:
                people[name] = Control.of(fit)
            except KinertiaError as error:
                out.print(f"left out: {error}", soft_wrap=True)
    columns = band_columns(list(people.values()))
    write_then_rename(output, _csv(columns))
    if mixed := mixture(list(people.values())):
        out.print(f"note: {mixed}", soft_wrap=True)
    spans = {name: columns[name][0] for name in columns if name.endswith(("_min", "_max"))}
    out.print(f"norms of {len(people)} people{_spans_text(spans)} in {output}", soft_wrap=True)
    summary = {"file": str(output), "people": sorted(people), "convention": columns["convention"][0], "note": mixed}
    return Outcome({**summary, **spans})


def _name(fit: Fit, folder: Path) -> str:
    """Return the person's name, or the folder's name if the fit is only named after its trial."""
    return folder.resolve().name if fit.subject.name in {trial.name for trial in fit.trials} else fit.subject.name


def _spans_text(spans: dict[str, float | None]) -> str:
    words = []
    for name, unit in (("age_years", "years"), ("speed_m_s", "m/s")):
        low, high = spans[f"{name}_min"], spans[f"{name}_max"]
        if low is not None and high is not None:
            words.append(f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}")
    return f" ({', '.join(words)})" if words else ""


def _csv(columns: dict[str, list[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow(
            ["" if cell is None else f"{cell:.6g}" if isinstance(cell, float) else inert(cell) for cell in row]
        )
    return text.getvalue()
