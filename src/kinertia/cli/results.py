"""Defines `kinertia report`, `export` and `compare`: what is made of finished results."""

from json import dumps
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from kinertia.cli.common import Outcome, Overwrite, Quiet, out, results_folder, shown_progress
from kinertia.errors import FileError
from kinertia.estimation.changes.session_changes import one_session_note
from kinertia.estimation.result.cycles import columns_of
from kinertia.estimation.result.fit import Fit
from kinertia.estimation.result.gait_scores import with_norms
from kinertia.estimation.result.mean_cycles import check_convention, gait_profile, profiles_by_task
from kinertia.io.norms_file import Norm, read_norms
from kinertia.io.output_folder import complete_folder, updated_files
from kinertia.io.subject.provenance import names_from_common_folder
from kinertia.io.versions import VERSION
from kinertia.motion.model_outputs import CLINICAL_ANGLES, CONVENTIONS
from kinertia.motion.spatiotemporal import MEASURES
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
from kinertia.report.comparison.what_changed import Comparison, compared_sessions, fit_of, noted, opened
from kinertia.report.comparison.what_changed import compare as compare_sessions
from kinertia.report.exports.c3d_results import write_c3d_results
from kinertia.report.exports.files import write_columns, write_draws
from kinertia.report.exports.saved_fit import read_saved
from kinertia.report.exports.workbook import write_csv, write_json, write_mat, write_xlsx
from kinertia.report.pages.file_outputs import outputs_sentence
from kinertia.report.pages.page import Template, render

LETTER = "letter.html"


def compare(
    results: Annotated[
        list[Path],
        typer.Argument(help="Two sessions or several results; one with --conditions."),
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
    absent = [str(path) for path in results if not path.exists()]
    if conditions is not None and (absent or len(results) > 2):
        taken = f"here {conditions[0]!r} and {conditions[1]!r}; sessions are then {', '.join(map(str, results))}"
        raise typer.BadParameter(f"--conditions takes two names, {taken}: give one or two that exist")
    if conditions is not None and len(results) == 1:
        return _compare_conditions(results[0], conditions, norms, output, overwrite)
    if not 2 <= len(results) <= MOST_FITS:
        hint = "; of one session, --conditions compares two conditions" if len(results) < 2 else ""
        raise typer.BadParameter(f"give 2 to {MOST_FITS} subject files or results; these are {len(results)}{hint}")
    paths = [path.resolve() for path in results]
    if len(set(paths)) < len(paths):
        raise typer.BadParameter("the same file or folder is given twice; for two conditions in it give it once")
    results_folder(output, overwrite)
    names = names_from_common_folder(paths)
    sources = opened(paths, conditions)
    if norms is not None:
        read_norms(norms)  # before the work: what is wrong with them
    with shown_progress() as progress:
        fits = {name: fit_of(source, progress) for name, source in zip(names, sources, strict=True)}
        found, reason = compared_sessions(list(fits.values()), conditions, progress, norms)
    found = None if found is None else noted(found, one_session_note(sources))
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
    out.print(
        f"{found.before} -> {found.after}; moments over body mass, internal unless called external", soft_wrap=True
    )
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
        changed = [f"{difference.parameter} of {difference.segment}" for difference in compared if difference.changed]
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


def report(
    results: Annotated[Path, typer.Argument(help="Folder written by kinertia fit.")],
    norms: Annotated[
        Path | None, typer.Option(help="CSV file with norms, drawn as bands: quantity,percent,mean,sd.")
    ] = None,
    letter: Annotated[
        bool, typer.Option("--letter", help="Write letter.html, too: two pages for a patient's file.")
    ] = False,
    quiet: Quiet = False,
) -> Outcome:
    """Write the report of a fit again, without the recordings: report.html in its folder is replaced.

    With --norms, gait-cycle figures show your laboratory's normative bands in
    grey. Bands made by kinertia norms add the Gait Profile Score (gps.csv, and
    of each stride in cycles.csv).

    [bold]Examples[/]

    kinertia report out

    kinertia report out --norms adults.csv --letter
    """
    saved = read_saved(results)
    bands, without_curve = ({}, []) if norms is None else _norms_for(saved.fit, norms)
    profile = gait_profile(saved.fit, bands) if set(CLINICAL_ANGLES) <= set(bands) else None
    content = (saved.fit, saved.provenance, saved.versions, bands, profiles_by_task(saved.fit, bands), saved.truth)
    pages: dict[str, Template] = {"report.html": "report"}
    if letter:
        pages[LETTER] = "letter"
    with updated_files(results, "fit", ["gps.csv", LETTER]) as work:
        for name, template in pages.items():
            (work / name).write_text(render(*content, template), encoding="utf-8", newline="\n")
        cycles = bands or (results / "cycles.csv").is_file()
        if cycles and any(trial.strides for trial in saved.fit.trials):
            columns = columns_of(saved.fit.curves["estimate"])
            columns = with_norms(columns, bands, saved.fit.skeleton) if bands else columns
            write_columns(work / "cycles.csv", columns, "%.6g")
        if profile:
            write_columns(work / "gps.csv", profile.columns(), "%.6g")
    for name, template in pages.items():
        out.print(f"{template} in {results / name}", soft_wrap=True)
    summary: dict[str, Any] = {template: str(results / name) for name, template in pages.items()}
    summary |= {"norms": list(bands)}
    if profile:
        overall = profile.overall_deg
        out.print(f"Gait Profile Score {score_text(overall)}; {results / 'gps.csv'}", soft_wrap=True)
        for remark in profile.remarks:
            out.print(f"note: {remark}", soft_wrap=True)
        summary |= {"gps_deg": overall if np.isfinite(overall) else None, "remarks": list(profile.remarks)}
    return Outcome({**summary, "without_curve": without_curve})


def score_text(degrees: float) -> str:
    """Format the score for a terminal; without complete curves of both sides there is none."""
    return f"{degrees:.1f} degrees" if np.isfinite(degrees) else "not available: one side has no complete curves"


def _norms_for(fit: Fit, path: Path) -> tuple[dict[str, Norm], list[str]]:
    """Read the norms in a file, and list those for which this fit has no curve, nor measure of strides."""
    norms, known = read_norms(path), {curve.quantity for curve in fit.curves["estimate"]}
    known |= set(MEASURES) if any(trial.strides for trial in fit.trials) else set()
    check_convention(fit, norms)
    unknown = sorted(set(norms) - known)
    if len(unknown) == len(norms):
        expected = f"use names from cycles.csv, such as {min(known)}" if known else "there are no strides"
        raise FileError(
            path, f"no quantity of it is among the curves of this fit (the first is {unknown[0]}); {expected}"
        )
    if unknown:
        out.print(f"note: norms that this fit has no curve for: {', '.join(unknown)}")
    return {name: norm for name, norm in norms.items() if name in known}, unknown


def _conventions(typed: str) -> list[str]:
    """Return completions that the shell offers for --convention."""
    return [name for name in CONVENTIONS if name.startswith(typed)]


def export(
    results: Annotated[Path, typer.Argument(help="Folder written by kinertia fit.")],
    csv: Annotated[bool, typer.Option("--csv", help="A file per table, for R and others.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One file, tables.json; the names of written files are also printed as JSON.")
    ] = False,
    xlsx: Annotated[
        bool, typer.Option("--xlsx", help="One workbook, tables.xlsx: strides, peaks, curves side by side, segments.")
    ] = False,
    mat: Annotated[bool, typer.Option("--mat", help="One file, tables.mat, for MATLAB and Octave.")] = False,
    c3d: Annotated[
        bool,
        typer.Option("--c3d", help="A copy of each trial's C3D file with the results, for Vicon, Visual3D and others."),
    ] = False,
    convention: Annotated[
        str | None,
        typer.Option(
            help="With --c3d: plug-in-gait (default for its marker sets) or isb (default otherwise).",
            autocompletion=_conventions,
        ),
    ] = None,
    recordings: Annotated[
        Path | None, typer.Option(help="With --c3d: folder with the recordings, if they are not found.")
    ] = None,
    draws: Annotated[
        int,
        typer.Option(
            "--draws", min=0, metavar="N", help="N posterior draws as OpenSim files: model, motion and loads together."
        ),
    ] = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the selection of draws; 0: the first ones.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the files.")] = Path("export"),
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> Outcome:
    """Write all tables of a fit (segments, calibration, strides, curves), C3D files or posterior draws.

    [bold]Examples[/]

    kinertia export out --csv

    kinertia export out --xlsx -o excel

    kinertia export out --c3d -o for-nexus

    kinertia export out --draws 50 -o draws
    """
    if not (csv or as_json or xlsx or mat or c3d or draws):
        forms = "--xlsx, --csv, --json, --mat, --c3d or --draws N"
        raise typer.BadParameter(f"choose a form: {forms} (several at once are fine)")
    if convention is not None and convention not in CONVENTIONS:
        raise typer.BadParameter(f"--convention is {' or '.join(CONVENTIONS)}, not '{convention}'")
    results_folder(output, overwrite)
    saved = read_saved(results)
    fit = saved.fit
    with complete_folder(output, "export") as work:
        content: dict[str, Any] = {"kinertia": VERSION, "results": str(results), "subject": fit.subject.model_dump()}
        if draws:
            content["draws"] = {"count": draws, "seed": seed}
        (work / "export.json").write_text(dumps(content, indent=2) + "\n", encoding="utf-8")
        if csv:
            write_csv(fit, work)
        if as_json:
            write_json(fit, work / "tables.json")
        if xlsx:
            write_xlsx(fit, work / "tables.xlsx")
        if mat:
            write_mat(fit, work / "tables.mat")
        if c3d:
            chosen = write_c3d_results(saved, results, recordings, convention, work)
            out.print(f"signs, axes and units in the C3D files: {chosen} (--convention)")
        if draws:
            write_draws(fit, work, draws, seed)
    out.print(f"files in {output}", soft_wrap=True)
    files = sorted(path.relative_to(output).as_posix() for path in output.rglob("*.*") if not path.name.startswith("."))
    return Outcome({"folder": str(output), "files": files})
