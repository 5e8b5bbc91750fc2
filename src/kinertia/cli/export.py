"""Defines `kinertia export`: tables, C3D files with results and posterior draws, for other programs."""

from json import dumps
from pathlib import Path
from typing import Annotated, Any

import typer

from kinertia.cli.options import Outcome, Overwrite, Quiet, results_folder
from kinertia.cli.terminal import out
from kinertia.io.results.output_folder import complete_folder
from kinertia.io.versions import VERSION
from kinertia.motion.model_outputs import CONVENTIONS
from kinertia.report.exports.c3d_results import write_c3d_results
from kinertia.report.exports.files import write_draws
from kinertia.report.exports.saved_fit import read_saved
from kinertia.report.exports.workbook import write_csv, write_json, write_mat, write_xlsx


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
